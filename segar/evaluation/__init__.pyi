from .baselines import (
    Baselines as Baselines,
    find_baselines as find_baselines,
    idle_actions as idle_actions,
    idle_player as idle_player,
    random_player as random_player,
)
from .episodes import QUANTITIES as QUANTITIES, PlayedEpisodes as PlayedEpisodes, play_episodes as play_episodes
from .policy_evaluation import (
    TRIAL_QUANTITIES as TRIAL_QUANTITIES,
    Evaluation as Evaluation,
    Interval as Interval,
    LevelSetResult as LevelSetResult,
    Policy as Policy,
    adaptation_gain,
    evaluate_levels as evaluate_levels,
    evaluate_policy,
    mean_of_levels as mean_of_levels,
    require_modes as require_modes,
    require_options as require_options,
)
from .recorded_actions import RecordedActions, record_actions

__all__ = ["RecordedActions", "adaptation_gain", "evaluate_policy", "record_actions"]
