"""The built-in tasks, and tasks by name."""

from segar.language import Task, set_default_task
from segar.tasks.billiards_task import billiards
from segar.tasks.invisiball_task import invisiball
from segar.tasks.puttputt_task import DEATH_PENALTY, GOAL_DISTANCE, IMPULSE, distance, puttputt
from segar.tasks.registry import TASKS, find_task, make_task, task_of

__all__ = [
    "DEATH_PENALTY", "GOAL_DISTANCE", "IMPULSE", "TASKS", "Task", "billiards", "distance", "find_task", "invisiball",
    "make_task", "puttputt", "set_default_task", "task_of",
]  # fmt: skip

set_default_task(puttputt)
