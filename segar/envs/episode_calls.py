"""The bookkeeping of episodes as calls of compiled functions, for other targets than this processor."""

import numpy as np

from segar.engine import Call, Given, Rows, call_of, with_distinct_names
from segar.envs.episode_kernel import check_actions, count_rows, start_episodes
from segar.errors import SegarError
from segar.levels import Levels
from segar.observations import BoundObservation, calls_of, without_calls

_ENVS = ("envs",)
_NUMBER, _SUM, _FLAG = Given("int64", _ENVS), Given("float64", _ENVS), Given("bool", _ENVS)


def start_call(levels: Levels, trials: int) -> Call:
    """Start episodes, ``trials`` in a row on each level.

    The caller gives ``seed`` and ``chosen`` beside the states, as :func:`start_episodes` has them.
    """
    values = Given("float64", (*_ENVS, *levels.values.shape[1:]))
    batch = [values, _NUMBER, Given("uint64", _ENVS), *[_NUMBER] * 3, _SUM, *[_NUMBER] * 2]
    given = [Rows(), Given("uint64", None), trials, _NUMBER, np.ascontiguousarray(levels.values), *batch]
    return call_of("start_episodes", start_episodes, given, {"level_values": ("levels", None, None)})


def observation_calls(
    observation: BoundObservation, target: str, advice: str, in_rows: bool = False
) -> tuple[tuple[Call, ...], tuple[Call, ...], tuple[Call, ...]]:
    """The calls of an observation.

    Args:
        target, advice: for the error: what lacks a compiled form, and what to do.
        in_rows: see :class:`segar.observations.RunsOnTargets`.

    Returns:
        What it needs when episodes start; what notes that a step was taken; what writes the observations of the present states.

    Raises:
        SegarError: it is not made by compiled functions alone.
    """
    lacking = without_calls(observation)
    if lacking is not None:
        raise SegarError(
            f"the observation {type(lacking).__name__} has no compiled form for {target}, which a state, 'rgb', 'textures',"
            f" stacks, previous actions, and tuples and dicts of these have; {advice}"
        )
    found = {when: calls_of(observation, when, in_rows) for when in ("start", "begin", "advance", "write")}
    named = iter(with_distinct_names([call for calls in found.values() for call in calls]))
    start, begin, advance, write = (tuple(next(named) for _ in calls) for calls in found.values())
    return (*start, *begin), advance, write


def count_call() -> Call:
    """Count a step; see :func:`count_rows`."""
    given = [Rows(), _SUM, _FLAG, Given("int64", None), _SUM, _NUMBER, _FLAG, _FLAG]
    return call_of("count_rows", count_rows, given, {})


def check_call(action_size: int) -> Call:
    """Note actions that are not finite; see :func:`check_actions`."""
    given = [Rows(), Given("float32", (*_ENVS, action_size)), Given("int64", (*_ENVS, 5))]
    return call_of("check_actions", check_actions, given, {})
