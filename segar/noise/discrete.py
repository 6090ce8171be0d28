"""Distributions made of atoms: ranges of whole numbers, choices, coin flips and constants."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
import scipy

from segar.errors import PriorError
from segar.noise.base import Noise, check_width, fraction, joined_atoms, set_fields, shape_of
from segar.noise.checks import finite, interval, members, points, probabilities
from segar.support import read_only

MOST_NUMBERS = 10_000_000  # of a range of whole numbers; each is an atom of 16 bytes
SHOWN = 8  # values that the repr of an empirical distribution shows


class DiscreteNoise(Noise):
    """A distribution that is all atoms; its sub-classes say which."""

    def cdf(self, x: Any) -> Any:
        values, masses = self.atoms
        if self.width == 2:
            return (np.all(points(self, x)[..., None, :] >= values, axis=-1) @ masses)[()]
        x = np.asarray(x, dtype=float)
        below = np.searchsorted(values, x, side="right")
        return np.concatenate([[0.0], np.cumsum(masses)[:-1], [1.0]])[below][()]

    def pmf(self, x: Any) -> Any:
        if self.width != 1:
            return super().pmf(x)
        values, masses = self.atoms
        x = np.asarray(x, dtype=float)
        place = np.minimum(np.searchsorted(values, x), len(values) - 1)
        return np.where(values[place] == x, masses[place], 0.0)[()]

    def icdf(self, q: Any) -> Any:
        check_width(self, 1)
        values, masses = self.atoms
        q = fraction(q)
        index = np.searchsorted(np.cumsum(masses)[:-1], q, side="left")
        return np.where(np.isnan(q), np.nan, values[index])[()]

    @property
    def mean(self) -> Any:
        values, masses = self.atoms
        return masses @ values

    @property
    def var(self) -> Any:
        values, masses = self.atoms
        return masses @ (values - self.mean) ** 2

    @property
    def support(self) -> Any:
        values, _ = self.atoms
        low, high = values.min(axis=0), values.max(axis=0)
        return tuple(zip(low.tolist(), high.tolist(), strict=True)) if self.width == 2 else (float(low), float(high))

    @property
    def pieces(self) -> np.ndarray:
        return self.atoms[0]

    @property
    def grid(self) -> tuple[np.ndarray, np.ndarray]:
        values = self.atoms[0]
        return np.unique(values[:, 0]), np.unique(values[:, 1])

    def entropy(self) -> float:
        return float(scipy.special.entr(self.atoms[1]).sum())


@dataclass(frozen=True, repr=False)
class DiscreteRangeNoise(DiscreteNoise):
    """A whole number from ``low`` to ``high``, both included, all equally likely."""

    low: int
    high: int

    def __post_init__(self) -> None:
        low, high = interval(self, "its range", (self.low, self.high))
        if not (low.is_integer() and high.is_integer()):
            raise PriorError(f"DiscreteRangeNoise: low and high must be whole numbers, not {self.low!r}, {self.high!r}")
        if max(-low, high) > 2**53 or high - low >= MOST_NUMBERS:
            raise PriorError(
                f"DiscreteRangeNoise: the range {low:.17g} to {high:.17g} has too many or too large numbers"
            )
        set_fields(self, low=int(low), high=int(high))

    def sample(self, rng: Any, size: Any = None) -> Any:
        return rng.integers(self.low, self.high, size=size, endpoint=True)

    @property
    def atoms(self) -> tuple[np.ndarray, np.ndarray]:
        values = np.arange(self.low, self.high + 1, dtype=float)
        return values, np.full(len(values), 1.0 / len(values))


@dataclass(frozen=True, repr=False)
class Bernoulli(DiscreteNoise):
    """True with probability ``p``, else false."""

    p: float = 0.5

    def __post_init__(self) -> None:
        finite(self, p=self.p)
        if not 0 <= self.p <= 1:
            raise PriorError(f"Bernoulli: p must lie in [0, 1], not {self.p!r}")

    def sample(self, rng: Any, size: Any = None) -> Any:
        return rng.random(size) < self.p

    @property
    def atoms(self) -> tuple[np.ndarray, np.ndarray]:
        return np.array([0.0, 1.0]), np.array([1.0 - self.p, self.p])


@dataclass(frozen=True, repr=False)
class Deterministic(DiscreteNoise):
    """A constant: a number, or a point of the plane.

    >>> float(segar.noise.Deterministic(0.5).mean)
    0.5
    """

    value: Any

    def __post_init__(self) -> None:
        try:
            array = np.asarray(self.value, dtype=float)
        except (TypeError, ValueError):
            array = np.full(3, np.nan)
        if array.shape not in ((), (2,)) or not np.isfinite(array).all():
            raise PriorError(f"Deterministic: the value must be a finite number or two, not {self.value!r}")
        object.__setattr__(self, "value", tuple(array.tolist()) if array.ndim else float(array))

    @property
    def width(self) -> int:  # type: ignore[override]
        return 2 if isinstance(self.value, tuple) else 1

    def sample(self, rng: Any, size: Any = None) -> Any:
        return np.broadcast_to(np.asarray(self.value), shape_of(size) + np.shape(self.value)).copy()[()]

    @property
    def atoms(self) -> tuple[np.ndarray, np.ndarray]:
        return np.array([self.value]), np.ones(1)


@dataclass(frozen=True, repr=False)
class Choice(DiscreteNoise):
    """One of ``keys``, by the probabilities ``p`` (equal ones if None).

    Keys are numbers, points ``(x, y)``, or anything else (shapes, for instance): such a distribution can be sampled and has an
    entropy, but no distribution function.
    """

    keys: Sequence[Any]
    p: Sequence[float] | None = None

    def __post_init__(self) -> None:
        given = members(self, "keys", self.keys)
        keys = tuple(tuple(k) if isinstance(k, (list, np.ndarray)) else k for k in given)
        if not keys:
            raise PriorError("Choice needs at least one key")
        object.__setattr__(self, "keys", keys)
        if not np.isfinite(self._numbers).all():
            raise PriorError(f"Choice: a key is not a finite number: {keys!r}; leave it out")
        object.__setattr__(self, "p", probabilities(self, self.p, len(keys)))

    @cached_property
    def width(self) -> int:  # type: ignore[override]
        return {(): 1, (2,): 2}.get(self._numbers.shape[1:], 0)

    def sample(self, rng: Any, size: Any = None) -> Any:
        index = self.sample_index(rng, size)
        if self.width:
            return self._numbers[index]
        members = np.empty(len(self.keys), dtype=object)
        members[:] = self.keys
        return members[index]

    def sample_index(self, rng: Any, size: Any = None) -> Any:
        """Draws of the place of a key in ``keys``."""
        return rng.choice(len(self.keys), size=size, p=self.p)

    @property
    def atoms(self) -> tuple[np.ndarray, np.ndarray]:
        if not self.width:
            raise PriorError(f"{self!r} chooses among things that are not numbers")
        return joined_atoms(self._numbers, self.p)

    def entropy(self) -> float:
        masses: dict[Any, float] = {}
        for key, p in zip(self.keys, self.p or (), strict=True):
            masses[key] = masses.get(key, 0.0) + p
        return float(scipy.special.entr(list(masses.values())).sum())

    @cached_property
    def _numbers(self) -> np.ndarray:
        """The keys as an array, of shape ``(n, 0)`` when they are not numbers or points."""
        numeric = all(isinstance(k, (bool, int, float, tuple, np.number, np.bool_)) for k in self.keys)
        points = [isinstance(k, tuple) for k in self.keys]
        if not numeric or any(points) != all(points) or any(len(k) != 2 for k in self.keys if isinstance(k, tuple)):
            return np.zeros((len(self.keys), 0))
        return np.array(self.keys, dtype=float)


@dataclass(frozen=True, repr=False)
class Empirical(DiscreteNoise):
    """One of the given ``values``, all equally likely: numbers ``(n,)``, or points ``(n, 2)``.

    Measured values become a distribution that can be sampled and compared; a value that was measured twice is twice as
    likely.
    """

    values: Any

    def __post_init__(self) -> None:
        try:
            array = np.asarray(self.values, dtype=float)
        except (TypeError, ValueError):
            array = np.full(1, np.nan)
        if array.ndim not in (1, 2) or array.shape[1:] not in ((), (2,)) or not len(array):
            raise PriorError(f"Empirical needs numbers (n,) or points (n, 2), not an array of shape {array.shape}")
        if not np.isfinite(array).all():
            raise PriorError("Empirical needs finite numbers; leave out those that are missing")
        object.__setattr__(self, "values", tuple(map(tuple, array.tolist())) if array.ndim == 2 else (*array.tolist(),))

    @property
    def width(self) -> int:  # type: ignore[override]
        return self._array.ndim

    def sample(self, rng: Any, size: Any = None) -> Any:
        return self._array[rng.integers(len(self._array), size=size)]

    @cached_property
    def atoms(self) -> tuple[np.ndarray, np.ndarray]:  # type: ignore[override]
        values, count = np.unique(self._array, axis=0, return_counts=True)
        return read_only(values), read_only(count / len(self._array))

    @cached_property
    def _array(self) -> np.ndarray:
        return np.array(self.values)

    def __repr__(self) -> str:
        shown = ", ".join(map(repr, self.values[:SHOWN]))
        return f"Empirical([{shown}])" if len(self.values) <= SHOWN else f"Empirical(<{len(self.values)} values>)"
