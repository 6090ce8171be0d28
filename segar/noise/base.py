"""What a law of chance is: sampled, and asked for density, distribution function, moments, entropy and distances.

A law may have atoms (a clipped Gaussian has one at each end): ``pmf`` is the mass of the atoms, ``pdf`` the density of
the rest, and ``log_prob`` the logarithm of whichever holds at the point. Logarithms are natural.
"""

from __future__ import annotations

import dataclasses
import math
from abc import ABC, abstractmethod
from collections.abc import Iterable
from functools import lru_cache
from typing import Any, ClassVar

import numpy as np

from segar.errors import PriorError
from segar.support import Estimate

PROBABILITY_SUM = 1e-9  # how far given probabilities may be from summing to one


class Noise(ABC):
    """A law of chance. A sub-class must say how to ``sample``; measures need ``cdf`` and ``pieces`` as well.

    Arguments ``x`` and ``q`` are numbers or arrays of any shape (for a law on the plane: ``(..., 2)``).
    """

    width: ClassVar[int] = 1
    """1 for a law on the line, 2 on the plane, 0 for choices among things that are not numbers."""

    @property
    def period(self) -> float | None:
        """After how much a number of the law comes round again, as angles do after 2 pi; None on the line.

        Distances to a law with a period are those on the circle."""
        return None

    @abstractmethod
    def sample(self, rng: Any, size: Any = None) -> Any:
        """Draws of shape ``size`` (for a law on the plane ``size + (2,)``).

        Args:
            rng: a ``numpy.random.Generator`` or a :class:`segar.support.counter_rng.LevelGenerator`.
        """

    def cdf(self, x: Any) -> Any:
        """Probability that a draw is at most ``x`` (on the plane: in both components)."""
        raise PriorError(f"{type(self).__name__} does not say its distribution function: define cdf(self, x)")

    def pdf(self, x: Any) -> Any:
        """Density at ``x`` of the part of the law that is not atoms."""
        x = np.asarray(x, dtype=float)
        return np.zeros(x.shape[:-1] if self.width == 2 else x.shape)[()]

    def pmf(self, x: Any) -> Any:
        """Mass of the atom at ``x``, zero where there is none."""
        x = np.asarray(x, dtype=float)
        mass = np.zeros(x.shape[:-1] if self.width == 2 else x.shape)
        for value, weight in zip(*self.atoms, strict=True):
            mass += weight * (np.all(x == value, axis=-1) if self.width == 2 else x == value)
        return mass[()]

    def log_prob(self, x: Any) -> Any:
        """Logarithm of the atom's mass where there is an atom, else of the density."""
        mass = self.pmf(x)
        with np.errstate(divide="ignore"):
            return np.log(np.where(mass > 0, mass, self.pdf(x)))[()]

    def icdf(self, q: Any) -> Any:
        """The smallest x with ``cdf(x) >= q``; nan outside [0, 1]."""
        from segar.noise.measures import invert_cdf

        return invert_cdf(self, q)

    @property
    def mean(self) -> Any:
        """Expectation: a number, or float64 ``(2,)``."""
        from segar.noise.measures import moments

        return moments(self)[0]

    @property
    def var(self) -> Any:
        """Variance: a number, or float64 ``(2,)`` of the components' variances."""
        from segar.noise.measures import moments

        return moments(self)[1]

    @property
    def support(self) -> Any:
        """Lowest and highest possible value ``(low, high)``; on the plane one such pair per component."""
        return float(self.pieces[0]), float(self.pieces[-1])

    @property
    def atoms(self) -> tuple[np.ndarray, np.ndarray]:
        """Values that have positive probability, ascending, and their masses."""
        return np.zeros(0), np.zeros(0)

    @property
    def pieces(self) -> np.ndarray:
        """Points, ascending, between which density and quantile function are smooth; all but 1e-20 of the mass lies
        between the first and the last. Integrals are computed piece by piece."""
        raise PriorError(f"{type(self).__name__} does not say where it lives: define the property pieces")

    def entropy(self) -> float:
        """Differential entropy of a density, Shannon entropy of atoms, their sum for a law that has both."""
        from segar.noise.measures import entropy

        return entropy(self)

    def w2(self, other: Any) -> float:
        """Wasserstein-2 distance to another law or to a constant; on the circle for a law with a ``period``."""
        from segar.noise.measures import as_noise, w2

        return w2(self, as_noise(other))

    def ks(self, other: Any) -> float:
        """Kolmogorov-Smirnov distance to another law or to a constant: the largest difference of the two ``cdf``; on the
        circle Kuiper's, the largest difference of the masses of an arc."""
        from segar.noise.measures import as_noise, ks

        return ks(self, as_noise(other))

    def w2_estimate(self, other: Any) -> Estimate:
        """``w2(other)`` with its error, zero where there is a closed form; see :mod:`segar.noise.measures`."""
        from segar.noise.measures import as_noise, w2_estimate

        return w2_estimate(self, as_noise(other))

    def ks_estimate(self, other: Any) -> Estimate:
        """``ks(other)`` with a bound of its error; see :mod:`segar.noise.measures`."""
        from segar.noise.measures import as_noise, ks_estimate

        return ks_estimate(self, as_noise(other))

    def __repr__(self) -> str:
        fields = dataclasses.fields(self) if dataclasses.is_dataclass(self) else ()
        return f"{type(self).__name__}({', '.join(repr(getattr(self, f.name)) for f in fields)})"


def shape_of(size: Any) -> tuple[int, ...]:
    """The shape that a ``size`` argument means: None one draw, a number so many, else the shape itself."""
    return () if size is None else (int(size),) if isinstance(size, (int, np.integer)) else tuple(size)


@lru_cache
def gauss_legendre(nodes: int) -> tuple[np.ndarray, np.ndarray]:
    """Nodes and weights of Gauss-Legendre quadrature on [-1, 1]."""
    return np.polynomial.legendre.leggauss(nodes)


def fraction(q: Any) -> np.ndarray:
    """``q`` as an array, nan outside [0, 1]."""
    q = np.asarray(q, dtype=float)
    return np.where((q >= 0) & (q <= 1), q, np.nan)


def finite(law: Noise, **numbers: Any) -> None:
    """Raise :class:`PriorError` unless all ``numbers`` are finite numbers."""
    for name, number in numbers.items():
        if isinstance(number, (bool, str)) or not np.isscalar(number) or not np.isfinite(number):
            raise PriorError(f"{type(law).__name__}: {name} must be a finite number, not {number!r}")


def members(law: Noise, name: str, given: Any) -> tuple[Any, ...]:
    """What is given as a tuple; raises :class:`PriorError` if it is a single thing."""
    if isinstance(given, str) or not isinstance(given, Iterable):
        raise PriorError(f"{type(law).__name__}: {name} must be a list, not {given!r}")
    return tuple(given)


def points(law: Noise, x: Any) -> np.ndarray:
    """``x`` as float64 ``(..., 2)``; raises :class:`PriorError` if these are not points."""
    x = np.asarray(x, dtype=float)
    if x.shape[-1:] != (2,):
        raise PriorError(f"{law!r} is a law on the plane: x must have shape (..., 2), not {x.shape}")
    return x


def interval(law: Noise, name: str, ends: Any, strict: bool = False) -> tuple[float, float]:
    """``(low, high)`` as floats; raises :class:`PriorError` if they are not two numbers in order."""
    try:
        low, high = (math.nan if isinstance(end, str) else float(end) for end in ends)
    except (TypeError, ValueError):
        low = high = math.nan
    if math.isnan(low) or math.isnan(high):
        raise PriorError(f"{type(law).__name__}: {name} must be two numbers (low, high), not {ends!r}")
    if not (low < high if strict else low <= high):
        hint = f"; did you mean ({high:g}, {low:g})?" if low > high else "; for a constant give the value itself"
        raise PriorError(f"{type(law).__name__}: {name} must go from low to high, not from {low:g} to {high:g}{hint}")
    if strict and not math.isfinite(high - low):
        raise PriorError(f"{type(law).__name__}: {name} must be finite, not ({low:g}, {high:g})")
    return low, high


def probabilities(law: Noise, weights: Any, count: int) -> tuple[float, ...]:
    """``count`` probabilities as floats, equal ones for None; raises :class:`PriorError`."""
    if weights is None:
        return (1.0 / count,) * count
    try:
        given = tuple(float(w) for w in weights)
    except (TypeError, ValueError):
        raise PriorError(f"{type(law).__name__}: probabilities must be a list of numbers, not {weights!r}") from None
    if len(given) != count:
        raise PriorError(f"{type(law).__name__}: {len(given)} probabilities were given for {count} members")
    if any(not w >= 0 for w in given) or abs(sum(given) - 1) > PROBABILITY_SUM:
        raise PriorError(f"{type(law).__name__}: probabilities must be at least 0 and sum to 1, not {given}")
    return given
