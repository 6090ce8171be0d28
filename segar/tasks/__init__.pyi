from .billiards_task import billiards
from .invisiball_task import invisiball
from .puttputt_task import DEATH_PENALTY as DEATH_PENALTY, GOAL_DISTANCE, IMPULSE as IMPULSE, distance, puttputt
from .registry import TASKS as TASKS, make_task as make_task, task_of as task_of

__all__ = ["GOAL_DISTANCE", "billiards", "distance", "invisiball", "puttputt"]
