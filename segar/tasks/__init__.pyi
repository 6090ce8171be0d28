from .billiards_task import billiards
from .conditional_task import (
    CONDITIONS as CONDITIONS,
    Contender as Contender,
    conditional_puttputt as conditional_puttputt,
    remembering_world as remembering_world,
    with_conditions as with_conditions,
)
from .invisiball_task import invisiball
from .puttputt_task import GOAL_DISTANCE, distance, puttputt
from .registry import TASKS as TASKS, make_task as make_task, task_of as task_of

__all__ = ["GOAL_DISTANCE", "billiards", "distance", "invisiball", "puttputt"]
