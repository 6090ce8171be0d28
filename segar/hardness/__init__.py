"""How hard levels are, what can be done in them, and how alike they are in that; and situations, in which worlds are
compared: all without training."""

from segar.hardness.controllability import FactorInfluence, Influence, influence
from segar.hardness.planner import PLAN_ARRAYS, Plan, plan, replay
from segar.hardness.report import Hardness, hardness, random_episodes, wilson_interval
from segar.hardness.rollouts import Episodes, make_starts
from segar.hardness.similarity import dynamics_distances, policy_similarity, policy_similarity_of_states
from segar.hardness.situations import Situations, make_situations

__all__ = [
    "PLAN_ARRAYS", "Episodes", "FactorInfluence", "Hardness", "Influence", "Plan", "Situations", "dynamics_distances",
    "hardness", "influence", "make_situations", "make_starts", "plan", "policy_similarity", "policy_similarity_of_states",
    "random_episodes", "replay", "wilson_interval",
]  # fmt: skip
