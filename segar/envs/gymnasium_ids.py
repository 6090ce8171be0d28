"""Gymnasium ids: ``Segar-<family>-<rgb|state>-v0``, whose reward is minus the squared distance to the goal, and
``Segar-<family>-<rgb|state>-linear-v0``, whose reward is minus the distance.

The default levels of the tasks have ``Segar-<puttputt|billiards|invisiball>-<rgb|state>-v0``.

Registering loads neither levels nor the engine: ``import segar`` does it.
"""

from itertools import product
from typing import Any

import gymnasium

from segar.levels import TASK_LEVELS, families

OBSERVATION_NAMES = ("rgb", "state")
REWARDS = {"": "squared", "-linear": "linear"}  # of PuttPutt, by what the ids of families say of it
TASKS = tuple(name for name in TASK_LEVELS if "-" not in name)  # a task's default levels have its name
MAKERS = "segar.envs.registration"
MAX_STEPS = 100  # of all their tasks


def register_all() -> None:
    """Register the ids of all families and tasks; ids that are registered already stay as they are."""
    for observation in OBSERVATION_NAMES:
        for name, (suffix, reward) in product(families(), REWARDS.items()):
            options = {"family_name": name, "observation": observation, "reward": reward}
            register_id(f"Segar-{name}-{observation}{suffix}-v0", MAKERS, MAX_STEPS, **options)
        for name in TASKS:
            register_id(f"Segar-{name}-{observation}-v0", MAKERS, MAX_STEPS, family_name=name, observation=observation)


def register_id(id_: str, module: str, max_steps: int, **options: Any) -> None:
    """Register an id, whose environments the module's ``make_env`` and ``make_vector_env`` make, unless it is known.

    Its episodes end after ``max_steps`` steps, or after ``max_episode_steps`` of ``gymnasium.make`` and ``make_vec``.
    """
    if id_ not in gymnasium.registry:
        single, batched = (f"{module}:{name}" for name in ("make_env", "make_vector_env"))
        gymnasium.register(id_, single, max_episode_steps=max_steps, kwargs=options, vector_entry_point=batched)
