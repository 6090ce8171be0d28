"""What a policy achieves on training levels and on test levels: episodes, the generalization gap, normalised scores.

The room plays policies of any framework, and knows none. Other rooms, and ``experiments``, use the names below.
"""

from segar.evaluation.baselines import Baselines, find_baselines, idle_actions
from segar.evaluation.episodes import QUANTITIES, PlayedEpisodes, play_episodes
from segar.evaluation.policy_evaluation import Evaluation, Interval, LevelSetResult, Policy, evaluate_policy

__all__ = [
    "QUANTITIES", "Baselines", "Evaluation", "Interval", "LevelSetResult", "PlayedEpisodes", "Policy",
    "evaluate_policy", "find_baselines", "idle_actions", "play_episodes",
]  # fmt: skip
