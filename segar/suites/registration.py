"""The environments that the Gymnasium ids of suites make; :mod:`segar.suites.gymnasium_ids` registers the ids."""

from typing import Any

import gymnasium

from segar.envs import Env, VectorEnv, known_options, require_known
from segar.errors import SuiteError
from segar.suites.sides import require_free, side_options
from segar.suites.suite_file import suite
from segar.support import is_whole

OF_LEVELS = {"num_levels", "seed"}


def make_env(suite_name: str, side: str, **options: Any) -> gymnasium.Env:
    """The single environment of an id; see :func:`make_vector_env`."""
    return Env(**_arguments(suite_name, side, options))


def make_vector_env(suite_name: str, side: str, num_envs: int = 1, **options: Any) -> gymnasium.vector.VectorEnv:
    """The batched environment of an id.

    Args:
        side: ``train`` or ``test``.
        num_envs: number of environments.
        options: ``seed`` (default 0) draws the training levels, and is the seed of the environment. ``num_levels``: of
            training, as many as the suite says by default; of the test, the first ones, by default all. All others go
            to :class:`segar.envs.VectorEnv`, but for those that the suite decides, such as ``task`` and ``max_steps``. The
            observation ``state`` hides what the suite hides, and ``rgb`` has the textures of the side.

    Raises:
        SuiteError: the suite is about textures, and the observation is ``state``; an option is the suite's; or there are not
            so many test levels.
    """
    return VectorEnv(num_envs=num_envs, **_arguments(suite_name, side, options))


def _arguments(suite_name: str, side: str, options: dict[str, Any]) -> dict[str, Any]:
    found = suite(suite_name)
    require_known(options, OF_LEVELS | known_options(VectorEnv) | known_options(Env))
    require_free(found, options)
    seed, number, observation = options.pop("seed", 0), options.pop("num_levels", None), options.pop("observation")
    count = len(found.test_levels)
    if side == "test" and number is not None and not (is_whole(number) and 1 <= number <= count):
        raise SuiteError(f"num_levels: {suite_name} has {count} test levels, not {number!r}")
    made = side_options(found, side, seed, training_levels=number if side == "train" else None, observation=observation)
    if side == "test" and number is not None:
        made["levels"] = made["levels"][:number]
    return {**made, "seed": seed, **options}
