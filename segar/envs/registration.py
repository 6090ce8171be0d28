"""Gymnasium ids: ``Segar-<family>-<rgb|state>-v0``, whose reward is minus the squared distance to the goal, and
``Segar-<family>-<rgb|state>-linear-v0``, whose reward is minus the distance.

The default levels of the tasks have ``Segar-<puttputt|billiards|invisiball>-<rgb|state>-v0``. In release 0.1 the version
stood for the reward: its ids that end in ``-v1`` make the same environments as today's that end in ``-linear-v0``.
"""

import warnings
from typing import Any

import gymnasium
from gymnasium.envs.registration import EnvSpec

from segar.envs.checks import known_options, require_known
from segar.envs.gym_env import Env
from segar.envs.vector import VectorEnv
from segar.levels import families, family
from segar.tasks import TASKS, puttputt

OBSERVATION_NAMES = ("rgb", "state")
OF_LEVELS = {"num_levels", "seed", "split"}
REWARDS = {"": "squared", "-linear": "linear"}  # of PuttPutt, by what the ids of families say of it
FORMER = {"linear": "v1"}  # rewards that were a version in release 0.1
ENTRY_POINT, VECTOR_ENTRY_POINT = (f"segar.envs.registration:{name}" for name in ("make_env", "make_vector_env"))


def register_all() -> None:
    """Register the ids of all families and tasks; ids that are registered already stay as they are."""
    for observation in OBSERVATION_NAMES:
        for name in families():
            for suffix, reward in REWARDS.items():
                id_ = _register(name, observation, suffix, {"reward": reward})
                if reward in FORMER:
                    _register_former(f"Segar-{name}-{observation}-{FORMER[reward]}", id_)
        for name in TASKS:
            _register(name, observation, "", {})


def _register(name: str, observation: str, suffix: str, options: dict[str, Any]) -> str:
    """Register an id unless it is known, and return it."""
    id_ = f"Segar-{name}-{observation}{suffix}-v0"
    if id_ not in gymnasium.registry:
        kwargs = {"family_name": name, "observation": observation, **options}
        gymnasium.register(id_, entry_point=ENTRY_POINT, vector_entry_point=VECTOR_ENTRY_POINT, kwargs=kwargs)
    return id_


def _register_former(former: str, id_: str) -> None:
    """Let Gymnasium find an id under the one that it had before.

    The entry has the name of today inside. Were it registered as a version 1, Gymnasium would call version 0 out of date.
    """
    if former not in gymnasium.registry:
        kwargs = {**gymnasium.registry[id_].kwargs, "renamed": f"{former} is now {id_}"}
        gymnasium.registry[former] = EnvSpec(
            id_, entry_point=ENTRY_POINT, vector_entry_point=VECTOR_ENTRY_POINT, kwargs=kwargs
        )


def make_env(family_name: str, reward: str | None = None, **options: Any) -> gymnasium.Env:
    """The single environment of an id; see :func:`make_vector_env`."""
    return Env(**_arguments(family_name, reward, options))


def make_vector_env(
    family_name: str, reward: str | None = None, num_envs: int = 1, **options: Any
) -> gymnasium.vector.VectorEnv:
    """The batched environment of an id.

    Args:
        family_name: name of the level distribution, as :func:`segar.family` knows it.
        reward: of PuttPutt, 'squared' or 'linear'; None for the task that the levels name.
        num_envs: number of environments.
        options: ``num_levels`` (default 100), ``seed`` (default 0) and ``split`` (default 'train') choose the level
            set; all others go to :class:`segar.envs.VectorEnv`.
    """
    return VectorEnv(num_envs=num_envs, **_arguments(family_name, reward, options))


def _arguments(family_name: str, reward: str | None, options: dict[str, Any]) -> dict[str, Any]:
    if "renamed" in options:
        warnings.warn(f"the Gymnasium id {options.pop('renamed')}", DeprecationWarning, stacklevel=3)
    require_known(options, OF_LEVELS | known_options(VectorEnv) | known_options(Env))
    seed = options.pop("seed", 0)
    levels = family(family_name).sample(options.pop("num_levels", 100), seed=seed, split=options.pop("split", "train"))
    if reward is not None:
        options.setdefault("task", puttputt(reward))
    return {"levels": levels, "seed": seed, **options}
