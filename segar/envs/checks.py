"""Checks of what environments are given: each names the argument, what is wrong with it, and what is right."""

import inspect
import math
from collections.abc import Iterable, Mapping, Sequence
from types import NoneType
from typing import Any

import numpy as np

from segar.errors import ActionError, LevelError, SegarError, UnknownOptionError, did_you_mean
from segar.support import is_whole

SEEDS = 2**64


def whole_number(name: str, value: Any, least: int, most: int) -> int:
    """The value, if it is a whole number from ``least`` to ``most`` and no truth; raises :class:`SegarError`."""
    if not is_whole(value) or not least <= value <= most:
        raise SegarError(f"{name} must be a whole number from {least} to {most}, not {shown(value)}")
    return int(value)


def seed_of(value: Any) -> int:
    """The value, if it is a seed; raises :class:`SegarError`."""
    if not is_whole(value) or not 0 <= value < SEEDS:
        raise SegarError(f"a seed is a whole number from 0 to 2^64 - 1, not {shown(value)}")
    return int(value)


def instance(name: str, value: Any, kind: type | tuple[type, ...], right: str) -> None:
    """Raise :class:`SegarError` unless the value is of the kind; ``right`` says how to make one."""
    if not isinstance(value, kind):
        raise SegarError(f"{name} must be {right}, not {shown(value)}")


def array_of(what: str, given: Any, dtype: Any, num_envs: int) -> np.ndarray | None:
    """What a caller gave for each environment, bool or int64 ``(num_envs,)``; None where it gave nothing.

    Raises:
        LevelError: it is something else.
    """
    if given is None:
        return None
    right = f"{what} must be {np.dtype(dtype)} of shape ({num_envs},), not"
    try:
        array = np.asarray(given.cpu() if hasattr(given, "cpu") else given)  # tensors may lie on a GPU
    except (ValueError, TypeError) as error:  # a ragged list
        raise LevelError(f"{right} {shown(given)}") from error
    kinds = "iu" if dtype is np.int64 else "b"
    if array.shape != (num_envs,) or array.dtype.kind not in kinds or isinstance(given, np.ma.MaskedArray):
        raise LevelError(f"{right} {array.dtype} of shape {array.shape}: {shown(given)}")
    return array.astype(dtype)


def options_of(options: Any, known: Sequence[str]) -> dict[str, Any]:
    """The options of a reset; raises :class:`SegarError` unless they are a mapping of what is known."""
    instance("reset: options", options, (Mapping, NoneType), f"a mapping such as {{'{known[0]}': ...}}, or None")
    for name in options or ():
        if name not in known:
            raise LevelError(f"reset: unknown option '{name}'.{did_you_mean(str(name), known)}")
    return dict(options or {})


def known_options(kind: type) -> set[str]:
    """Names of the arguments of an environment's class, without the levels."""
    parameters = inspect.signature(kind).parameters.values()
    return {p.name for p in parameters if p.kind is not p.VAR_KEYWORD} - {"levels"}


def require_known(options: Mapping[str, Any], known: Iterable[str]) -> None:
    """Raise :class:`UnknownOptionError` for an option that no environment has."""
    for name in options:
        if name not in known:  # in Python's words, which other packages look for
            raise UnknownOptionError(
                f"an environment got an unexpected keyword argument '{name}'.{did_you_mean(name, known)}"
            )


def actions_of(actions: Any, shape: tuple[int, ...]) -> np.ndarray:
    """The actions as float32 of this shape, finite.

    Args:
        shape: ``(num_envs, action size)``, or ``(action size,)`` for those of a single environment.

    Raises:
        ActionError: they are no numbers, have another shape, or are not finite; the message names the environment.
    """
    if isinstance(actions, np.ma.MaskedArray):
        raise ActionError("actions are masked; give numbers for all of them, as in actions.filled(0)")
    try:
        array = np.asarray(actions)
        real = array.dtype.kind in "fiu"
    except Exception as error:  # ragged lists, tensors on a device or with gradients: each has an error of its own
        raise ActionError(f"actions must be numbers of shape {shape}, not {shown(actions)}: {error}") from error
    if not real:
        raise ActionError(f"actions must be real numbers of shape {shape}, not {shown(actions)} (dtype {array.dtype})")
    if array.shape != shape:
        raise ActionError(f"actions must have shape {shape}, not {array.shape}")
    given = array
    if array.dtype != np.float32:
        with np.errstate(over="ignore"):
            array = array.astype(np.float32)
    # The sum of squares costs a quarter of looking at each number; numbers so large that it overflows are looked at.
    if not math.isfinite(np.vdot(array, array)) and not np.isfinite(array).all():
        rows = array.reshape(-1, shape[-1])
        env = int(np.flatnonzero(~np.isfinite(rows).all(axis=1))[0])
        if np.isfinite(given.reshape(-1, shape[-1])[env].astype(np.float64)).all():
            first = given.reshape(-1, shape[-1])[env]
            raise ActionError(
                f"the action of environment {env} is out of the range of float32: {first}; give smaller numbers"
            )
        raise ActionError(f"the action of environment {env} is not finite: {rows[env]}; give finite float32 numbers")
    return array


def shown(value: Any) -> str:
    """The value in short, with its type where that does not show."""
    text = " ".join(repr(value).split())
    text = text if len(text) <= 60 else f"{text[:57]}..."
    plain = isinstance(value, (str, int, float, bool, list, tuple, dict, type(None)))
    return text if plain else f"{text} ({type(value).__name__})"
