"""The environments that Gymnasium's ids make; :mod:`segar.envs.gymnasium_ids` registers the ids."""

from typing import Any

import gymnasium

from segar.envs.checks import known_options, require_known
from segar.envs.gym_env import Env
from segar.envs.vector import VectorEnv
from segar.levels import family
from segar.tasks import puttputt

OF_LEVELS = {"num_levels", "seed", "split"}


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
