"""Gymnasium ids: ``Segar-<family>-<rgb|state>-v0``, whose reward is minus the squared distance to the goal, and
``Segar-<family>-<rgb|state>-linear-v0``, whose reward is minus the distance.

The default levels of the tasks have ``Segar-<puttputt|billiards|invisiball>-<rgb|state>-v0``.

Registering loads neither levels nor the engine: ``import segar`` does it.
"""

from typing import Any

import gymnasium

from segar.levels import TASK_LEVELS, families

OBSERVATION_NAMES = ("rgb", "state")
REWARDS = {"": "squared", "-linear": "linear"}  # of PuttPutt, by what the ids of families say of it
TASKS = tuple(name for name in TASK_LEVELS if "-" not in name)  # a task's default levels have its name
ENTRY_POINT, VECTOR_ENTRY_POINT = (f"segar.envs.registration:{name}" for name in ("make_env", "make_vector_env"))


def register_all() -> None:
    """Register the ids of all families and tasks; ids that are registered already stay as they are."""
    for observation in OBSERVATION_NAMES:
        for name in families():
            for suffix, reward in REWARDS.items():
                _register(name, observation, suffix, {"reward": reward})
        for name in TASKS:
            _register(name, observation, "", {})


def _register(name: str, observation: str, suffix: str, options: dict[str, Any]) -> None:
    """Register an id unless it is known."""
    id_ = f"Segar-{name}-{observation}{suffix}-v0"
    if id_ not in gymnasium.registry:
        kwargs = {"family_name": name, "observation": observation, **options}
        gymnasium.register(id_, entry_point=ENTRY_POINT, vector_entry_point=VECTOR_ENTRY_POINT, kwargs=kwargs)
