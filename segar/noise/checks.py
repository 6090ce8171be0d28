"""Checks of what distributions are made from: finite numbers, intervals, lists, probabilities, points of the plane."""

import math
from collections.abc import Iterable, Mapping
from typing import Any

import numpy as np

from segar.errors import PriorError

PROBABILITY_SUM = 1e-9  # how far given probabilities may be from summing to one


def finite(owner: object, **numbers: Any) -> None:
    """Raise :class:`PriorError`, which names the class of ``owner``, unless all ``numbers`` are finite numbers."""
    for name, number in numbers.items():
        if isinstance(number, (bool, str)) or not np.isscalar(number) or not np.isfinite(number):
            raise PriorError(f"{type(owner).__name__}: {name} must be a finite number, not {number!r}")


def members(owner: object, name: str, given: Any) -> tuple[Any, ...]:
    """The members of a list as a tuple; raises :class:`PriorError` if ``given`` is a text, a single thing, a set, which has no
    order, or a mapping, whose values would be left out."""
    if isinstance(given, str | set | frozenset | Mapping) or not isinstance(given, Iterable):
        raise PriorError(f"{type(owner).__name__}: {name} must be a list, not {given!r}")
    return tuple(given)


def points(owner: object, x: Any) -> np.ndarray:
    """``x`` as float64 ``(..., 2)``; raises :class:`PriorError` if these are not points."""
    x = np.asarray(x, dtype=float)
    if x.shape[-1:] != (2,):
        raise PriorError(f"{owner!r} is a distribution on the plane: x must have shape (..., 2), not {x.shape}")
    return x


def interval(owner: object, name: str, ends: Any, strict: bool = False) -> tuple[float, float]:
    """``(low, high)`` as floats; raises :class:`PriorError` if they are not two numbers in order.

    Args:
        strict: the ends must be finite and differ.
    """
    try:
        low, high = (math.nan if isinstance(end, str) else float(end) for end in ends)
    except (TypeError, ValueError):
        low = high = math.nan
    if math.isnan(low) or math.isnan(high):
        raise PriorError(f"{type(owner).__name__}: {name} must be two numbers (low, high), not {ends!r}")
    if not (low < high if strict else low <= high) or low == math.inf or high == -math.inf:
        hint = f"; did you mean ({high:g}, {low:g})?" if low > high else "; for a constant give the value itself"
        raise PriorError(f"{type(owner).__name__}: {name} must go from low to high, not from {low:g} to {high:g}{hint}")
    if strict and not math.isfinite(high - low):
        raise PriorError(f"{type(owner).__name__}: {name} must be finite, not ({low:g}, {high:g})")
    return low, high


def probabilities(owner: object, weights: Any, count: int) -> tuple[float, ...]:
    """``count`` probabilities as floats, equal ones for None.

    Raises:
        PriorError: they are not ``count`` numbers, one is negative, or they do not sum to 1.
    """
    if weights is None:
        return (1.0 / count,) * count
    try:
        given = tuple(float(w) for w in members(owner, "probabilities", weights))
    except (TypeError, ValueError):
        raise PriorError(f"{type(owner).__name__}: probabilities must be a list of numbers, not {weights!r}") from None
    if len(given) != count:
        raise PriorError(f"{type(owner).__name__}: {len(given)} probabilities were given for {count} members")
    if any(not w >= 0 for w in given) or abs(sum(given) - 1) > PROBABILITY_SUM:
        raise PriorError(f"{type(owner).__name__}: probabilities must be at least 0 and sum to 1, not {given}")
    return given
