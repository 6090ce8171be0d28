"""Gymnasium ids: ``Segar-<family>-<rgb|state>-<v0|v1>``; v1 rewards minus the distance instead of its square.

The default levels of the tasks have v0 alone: ``Segar-<puttputt|billiards|invisiball>-<rgb|state>-v0``.
"""

from typing import Any

import gymnasium

from segar.envs.checks import known_options, require_known
from segar.envs.gym_env import Env
from segar.envs.vector import VectorEnv
from segar.levels import families, family
from segar.tasks import TASKS, puttputt

OBSERVATION_NAMES = ("rgb", "state")
OF_LEVELS = {"num_levels", "seed", "split"}
REWARDS = {"v0": "squared", "v1": "linear"}


def register_all() -> None:
    """Register the ids of all families and tasks; ids that are registered already stay as they are."""
    for observation in OBSERVATION_NAMES:
        for name in families():
            for version, reward in REWARDS.items():
                _register(f"Segar-{name}-{observation}-{version}", name, observation, {"reward": reward})
        for name in TASKS:
            _register(f"Segar-{name}-{observation}-v0", name, observation, {})


def _register(id_: str, family_name: str, observation: str, options: dict[str, Any]) -> None:
    if id_ not in gymnasium.registry:
        gymnasium.register(
            id=id_,
            entry_point="segar.envs.registration:make_env",
            vector_entry_point="segar.envs.registration:make_vector_env",
            kwargs={"family_name": family_name, "observation": observation, **options},
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
    require_known(options, OF_LEVELS | known_options(VectorEnv) | known_options(Env))
    seed = options.pop("seed", 0)
    levels = family(family_name).sample(options.pop("num_levels", 100), seed=seed, split=options.pop("split", "train"))
    if reward is not None:
        options.setdefault("task", puttputt(reward))
    return {"levels": levels, "seed": seed, **options}
