from .baselines import Baselines as Baselines, find_baselines as find_baselines
from .episodes import QUANTITIES as QUANTITIES, PlayedEpisodes as PlayedEpisodes, play_episodes
from .players import Idle, Random as Random, Scripted
from .policy_evaluation import (
    TRIAL_QUANTITIES as TRIAL_QUANTITIES,
    Evaluation as Evaluation,
    Interval as Interval,
    LevelSetResult as LevelSetResult,
    adaptation_gain,
    checked_actions as checked_actions,
    evaluate_levels as evaluate_levels,
    evaluate_policy,
    mean_of_levels as mean_of_levels,
    require_modes as require_modes,
    require_options as require_options,
)
from .recorded_actions import RecordedActions, record_actions

__all__ = [
    "Idle",
    "RecordedActions",
    "Scripted",
    "adaptation_gain",
    "evaluate_policy",
    "play_episodes",
    "record_actions",
]
