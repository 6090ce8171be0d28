"""The environments that Gymnasium's ids make; :mod:`segar.envs.gymnasium_ids` registers the ids."""

from typing import Any

from segar.envs.checks import known_options, require_known, whole_number
from segar.envs.gym_env import Env
from segar.envs.gymnasium_ids import MAX_STEPS
from segar.envs.vector import VectorEnv
from segar.language import NO_LIMIT
from segar.levels import family
from segar.tasks import puttputt

OF_LEVELS = {"num_levels", "split"}


def make_env(family_name: str, reward: str | None = None, **options: Any) -> Env:
    """The single environment of an id; see :func:`make_vector_env`. Gymnasium's ``TimeLimit`` ends its episodes."""
    return Env(**_arguments(family_name, reward, options))


make_env.metadata = Env.metadata  # type: ignore[attr-defined] - Gymnasium's; it chooses wrappers by the render modes


def make_vector_env(
    family_name: str, reward: str | None = None, num_envs: int = 1, max_episode_steps: int = MAX_STEPS, **options: Any
) -> VectorEnv:
    """The batched environment of an id.

    Args:
        family_name: name of the level distribution, as :func:`segar.family` knows it.
        reward: of PuttPutt, 'squared' or 'linear'; None for the task that the levels name.
        num_envs: number of environments.
        max_episode_steps: an episode is truncated after this many steps, -1 for no limit; or after ``max_steps``, or that of
            the ``task``, where one of these is given and comes first.
        options: ``num_levels`` (default 100), ``seed`` (default 0) and ``split`` (default 'train') choose the level set.
            Where ``seed`` is given, it seeds the episodes, too; otherwise they are others in each environment.
            ``true_factors`` is False by default, because TorchRL reads no dicts within the ``info`` of batches. All other
            options go to :class:`segar.envs.VectorEnv`.

    Raises:
        UnknownOptionError: there is no such option. SegarError: an option has no such value.
    """
    made = _arguments(family_name, reward, {"true_factors": False, **options})
    if max_episode_steps != -1:
        made["max_steps"] = min(made["max_steps"], whole_number("max_episode_steps", max_episode_steps, 1, NO_LIMIT))
    return VectorEnv(num_envs=num_envs, **made)


def _arguments(family_name: str, reward: str | None, options: dict[str, Any]) -> dict[str, Any]:
    require_known(options, OF_LEVELS | known_options(VectorEnv) | known_options(Env))
    number, split = options.pop("num_levels", 100), options.pop("split", "train")
    levels = family(family_name).sample(number, seed=options.get("seed") or 0, split=split)
    limit = options.pop("max_steps", None) or getattr(options.get("task"), "max_steps", NO_LIMIT)
    if reward is not None:
        options.setdefault("task", puttputt(reward))
    return {"levels": levels, "max_steps": whole_number("max_steps", limit, 1, NO_LIMIT), **options}
