from .controllability import influence
from .planner import PLAN_ARRAYS as PLAN_ARRAYS, Plan as Plan, plan, replay
from .report import (
    Hardness as Hardness,
    hardness,
    random_episodes as random_episodes,
    wilson_interval as wilson_interval,
)
from .rollouts import make_starts as make_starts
from .similarity import (
    dynamics_distances,
    policy_similarity,
)
from .situations import Situations as Situations, make_situations

__all__ = ["dynamics_distances", "hardness", "influence", "make_situations", "plan", "policy_similarity", "replay"]
