"""What a policy achieves on training levels and on test levels: episodes, the generalization gap, normalised scores; recorded
actions.

The room plays policies of any framework, and knows none. Other rooms, and ``experiments``, use the names below.
"""

from segar.evaluation.baselines import Baselines, find_baselines, idle_actions, idle_player, random_player
from segar.evaluation.episodes import QUANTITIES, PlayedEpisodes, play_episodes
from segar.evaluation.policy_evaluation import (
    TRIAL_QUANTITIES,
    Evaluation,
    Interval,
    LevelSetResult,
    Policy,
    adaptation_gain,
    evaluate_levels,
    evaluate_policy,
    mean_of_levels,
    require_modes,
    require_options,
)
from segar.evaluation.recorded_actions import RecordedActions, record_actions

__all__ = [
    "QUANTITIES", "TRIAL_QUANTITIES", "Baselines", "Evaluation", "Interval", "LevelSetResult", "PlayedEpisodes", "Policy",
    "RecordedActions", "adaptation_gain", "evaluate_levels", "evaluate_policy", "find_baselines", "idle_actions", "idle_player",
    "mean_of_levels", "play_episodes", "random_player", "record_actions", "require_modes", "require_options",
]  # fmt: skip
