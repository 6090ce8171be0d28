"""The environments that the Gymnasium ids of suites make; :mod:`segar.suites.gymnasium_ids` registers the ids."""

from typing import Any

from segar.envs import Env, VectorEnv, known_options, require_known
from segar.errors import SuiteError
from segar.language import NO_LIMIT
from segar.suites.gymnasium_ids import MAX_STEPS
from segar.suites.sides import require_free, side_options
from segar.suites.suite_file import suite
from segar.support import is_whole

OF_LEVELS = {"num_levels"}


def make_env(suite_name: str, side: str, **options: Any) -> Env:
    """The single environment of an id, whose episodes Gymnasium's ``TimeLimit`` ends; see :func:`make_vector_env`."""
    return Env(max_steps=NO_LIMIT, **_arguments(suite_name, side, options))


make_env.metadata = Env.metadata  # type: ignore[attr-defined] - Gymnasium's; it chooses wrappers by the render modes


def make_vector_env(
    suite_name: str, side: str, num_envs: int = 1, max_episode_steps: int = MAX_STEPS, **options: Any
) -> VectorEnv:
    """The batched environment of an id.

    Args:
        side: ``train`` or ``test``.
        max_episode_steps: an episode is truncated after this many steps, -1 for no limit.
        options: ``seed`` (default 0) draws the training levels. Where it is given, it seeds the episodes, too; otherwise
            they are others in each environment. ``num_levels``: of training, as many as the suite says by default; of the
            test, the first ones, by default all. ``true_factors`` is False by default. All others go to
            :class:`segar.envs.VectorEnv`, but for those that the suite decides, such as ``task`` and ``max_steps``. The
            observation ``state`` hides what the suite hides, and ``rgb`` has the textures of the side.

    Raises:
        SuiteError: the suite is about textures, and the observation is ``state``; an option is the suite's; or there are not
            so many test levels.
    """
    made = _arguments(suite_name, side, {"true_factors": False, **options})
    return VectorEnv(num_envs=num_envs, max_steps=NO_LIMIT if max_episode_steps == -1 else max_episode_steps, **made)


def _arguments(suite_name: str, side: str, options: dict[str, Any]) -> dict[str, Any]:
    found = suite(suite_name)
    require_known(options, OF_LEVELS | known_options(VectorEnv) | known_options(Env))
    require_free(found, options)
    seed, number, observation = options.get("seed") or 0, options.pop("num_levels", None), options.pop("observation")
    count = len(found.test_levels)
    if side == "test" and number is not None and not (is_whole(number) and 1 <= number <= count):
        raise SuiteError(f"num_levels: {suite_name} has {count} test levels, not {number!r}")
    made = side_options(found, side, seed, training_levels=number if side == "train" else None, observation=observation)
    if side == "test" and number is not None:
        made["levels"] = made["levels"][:number]
    return {**made, **options}
