"""What every distribution says of itself: draws, density, distribution function, quantiles, moments and entropy.

A distribution may have atoms (a clipped Gaussian has one at each end): ``pmf`` is the mass of the atoms, ``pdf`` the
density of the rest, and ``log_prob`` the logarithm of whichever holds at the point. Logarithms are natural.

Quantiles, moments and entropy are computed here for any distribution, by bisection and Gauss-Legendre quadrature over
its ``pieces``; sub-classes with a closed form override them.
"""

from __future__ import annotations

import dataclasses
from abc import ABC, abstractmethod
from collections.abc import Callable
from functools import lru_cache
from typing import Any, ClassVar

import numpy as np
import scipy

from segar.errors import PriorError
from segar.support import Estimate, read_only

NODES = 24  # of Gauss-Legendre quadrature per piece: errors below 1e-10 for Gaussian pieces one sigma wide
PLANE_NODES = 8  # of quadrature per cell and axis of a grid on the plane
BISECTIONS = 60  # of a piece, to find a quantile: exact to rounding
LAST_QUANTILE = 1 - 2.0**-53  # largest probability below one: the quantile of one may be infinite
ROUNDING = 1e-13  # of sums of masses
KS_TOLERANCE = 1e-6  # to which the Kolmogorov-Smirnov distance is bounded
MISSING_MASS = 1e-6  # that quadrature may miss before a distribution counts as having mass on lines

DISTANCES: dict[str, Callable[..., Estimate]] = {}
"""Name of a distance to the function of two distributions that computes it.

A distance of two distributions depends on the classes of both, and these classes inherit from :class:`Noise`. So this
module cannot import the distances; :mod:`segar.noise.distances`, which knows all classes, enters them here.
"""


class Noise(ABC):
    """A distribution. A sub-class must say how to ``sample``; measures need ``cdf`` and ``pieces`` as well.

    Arguments ``x`` and ``q`` are numbers or arrays of any shape (for a distribution on the plane: ``(..., 2)``).

    >>> isinstance(segar.UniformNoise(0.0, 1.0), segar.noise.Noise)
    True
    """

    width: ClassVar[int] = 1
    """1 for a distribution on the line, 2 on the plane, 0 for choices among things that are not numbers."""

    @property
    def period(self) -> float | None:
        """The length of the circle that the numbers live on, such as 2 pi for angles [rad]; None on the line.

        Distances to a distribution with a period are those on the circle."""
        return None

    @abstractmethod
    def sample(self, rng: Any, size: Any = None) -> Any:
        """Draws of shape ``size`` (for a distribution on the plane ``size + (2,)``).

        Args:
            rng: a ``numpy.random.Generator`` or a :class:`segar.support.counter_rng.LevelGenerator`.
        """

    def cdf(self, x: Any) -> Any:
        """Probability that a draw is at most ``x`` (on the plane: in both components)."""
        raise PriorError(f"{type(self).__name__} does not say its distribution function: define cdf(self, x)")

    def pdf(self, x: Any) -> Any:
        """Density at ``x`` of the part of the distribution that is not atoms."""
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
        check_width(self, 1)
        q = np.asarray(q, dtype=float)
        grid = self.pieces
        right = np.clip(np.searchsorted(np.asarray(self.cdf(grid)), q, side="left"), 0, len(grid) - 1)
        low, high = grid[np.maximum(right - 1, 0)].copy(), grid[right].copy()
        for _ in range(BISECTIONS):
            middle = 0.5 * (low + high)
            reached = self.cdf(middle) >= q
            high = np.where(reached, middle, high)
            low = np.where(reached, low, middle)
        return np.where((q >= 0) & (q <= 1), high, np.nan)[()]

    @property
    def mean(self) -> Any:
        """Expectation: a number, or float64 ``(2,)``."""
        return moments(self)[0]

    @property
    def var(self) -> Any:
        """Variance: a number, or float64 ``(2,)`` of the components' variances."""
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

    @property
    def grid(self) -> tuple[np.ndarray, np.ndarray]:
        """Of a distribution on the plane, values of x and of y where ``cdf`` bends or jumps, and enough between them to
        see its shape."""
        raise PriorError(f"{type(self).__name__} does not say where its cdf bends: define the property grid")

    @property
    def components(self) -> tuple[Noise, Noise] | None:
        """Of a distribution on the plane, the distributions of x and of y where they are independent, else None."""
        return None

    def entropy(self) -> float:
        """Differential entropy of a density, Shannon entropy of atoms, their sum for a distribution that has both [nats].

        Raises:
            PriorError: a distribution on the plane has mass on lines, where it has neither atoms nor a density.
        """
        masses = self.atoms[1]
        if self.width == 2:
            (x, wx), (y, wy) = (quadrature(line, PLANE_NODES) for line in self.grid)
            density = self.pdf(np.stack(np.meshgrid(x, y, indexing="ij"), axis=-1))
            missing = 1.0 - masses.sum() - wx @ density @ wy
            if abs(missing) > MISSING_MASS:
                raise PriorError(f"{self!r}: {missing:.3g} of its mass lies on lines, where entropy has no common unit")
            return float(scipy.special.entr(masses).sum() + wx @ scipy.special.entr(density) @ wy)
        check_width(self, 1)
        x, weight = quadrature(self.pieces)
        return float(scipy.special.entr(masses).sum() + weight @ scipy.special.entr(self.pdf(x)))

    def w2(self, other: Any) -> float:
        """Wasserstein-2 distance to another distribution or to a constant (Villani 2009, section 6).

        It is measured on the circle if one of them has a ``period``.
        """
        return self.w2_estimate(other).value

    def w2_estimate(self, other: Any) -> Estimate:
        """``w2(other)`` with its error, zero where there is a closed form; see :mod:`segar.noise.distances`."""
        return DISTANCES["w2_estimate"](self, other)

    def ks(self, other: Any) -> float:
        """Kolmogorov-Smirnov distance to another distribution or to a constant: the largest difference of the two
        ``cdf``; on the circle Kuiper's (1960), the largest difference of the masses of an arc."""
        return DISTANCES["ks_estimate"](self, other, np.inf).value

    def ks_estimate(self, other: Any) -> Estimate:
        """``ks(other)`` with a bound of its error; see :mod:`segar.noise.distances`."""
        return DISTANCES["ks_estimate"](self, other, KS_TOLERANCE)

    def __repr__(self) -> str:
        fields = dataclasses.fields(self) if dataclasses.is_dataclass(self) else ()
        return f"{type(self).__name__}({', '.join(repr(getattr(self, f.name)) for f in fields)})"


def moments(distribution: Noise) -> tuple[float, float]:
    """Mean and variance of a distribution on the line, by quadrature of its quantile function."""
    check_width(distribution, 1)
    q, weight = quantile_nodes(distribution)
    x = distribution.icdf(q)
    mean = float(weight @ x)
    return mean, float(weight @ (x - mean) ** 2)


def quantile_nodes(*distributions: Noise, nodes: int = NODES) -> tuple[np.ndarray, np.ndarray]:
    """Nodes and weights on (0, 1) between the probabilities at which some quantile function may bend or jump."""
    levels = [np.array([0.0, 1.0]), *map(quantile_bends, distributions)]
    q, weight = quadrature(np.unique(np.concatenate(levels)), nodes)
    return np.clip(q, None, LAST_QUANTILE), weight


def quantile_bends(distribution: Noise) -> np.ndarray:
    """The probabilities at which the quantile function of a distribution on the line may bend or jump."""
    p = np.asarray(distribution.cdf(distribution.pieces), dtype=float)
    return np.clip(np.concatenate([p, p - distribution.pmf(distribution.pieces)]), 0.0, 1.0)


def quadrature(edges: np.ndarray, nodes: int = NODES) -> tuple[np.ndarray, np.ndarray]:
    """Gauss-Legendre nodes and weights on each interval between ascending ``edges``, flat; one node is for steps, whose
    edges are the same if they are so up to rounding."""
    if nodes == 1:
        edges = edges[np.append(np.diff(edges) > ROUNDING, True)]
    z, weight = gauss_legendre(nodes)
    half, middle = np.diff(edges) / 2, (edges[1:] + edges[:-1]) / 2
    return (middle[:, None] + half[:, None] * z).ravel(), (half[:, None] * weight).ravel()


@lru_cache
def gauss_legendre(nodes: int) -> tuple[np.ndarray, np.ndarray]:
    """Nodes and weights of Gauss-Legendre quadrature on [-1, 1]."""
    return np.polynomial.legendre.leggauss(nodes)


def check_width(distribution: Noise, width: int) -> None:
    """Raise :class:`PriorError` unless the distribution has this ``width``, 1 or 2."""
    if distribution.width != width or not width:
        place = {0: "among things that are not numbers", 1: "on the line", 2: "on the plane"}
        raise PriorError(
            f"{distribution!r} is a distribution {place[distribution.width]}; here one {place[width or 1]} is needed"
        )


def joined_atoms(values: np.ndarray, masses: Any) -> tuple[np.ndarray, np.ndarray]:
    """The distinct ones of ``values``, float64 ``(n,)`` or ``(n, 2)``, ascending, and the summed masses of each; read-only."""
    distinct, place = np.unique(values, axis=0, return_inverse=True)
    return read_only(distinct), read_only(np.bincount(place.ravel(), weights=masses, minlength=len(distinct)))


def set_fields(owner: object, **fields: Any) -> None:
    """Set fields of a frozen dataclass while it is made."""
    for name, value in fields.items():
        object.__setattr__(owner, name, value)


def shape_of(size: Any) -> tuple[int, ...]:
    """The shape that a ``size`` argument means: None one draw, a number so many, else the shape itself."""
    return () if size is None else (int(size),) if isinstance(size, (int, np.integer)) else tuple(size)


def fraction(q: Any) -> np.ndarray:
    """``q`` as an array, nan outside [0, 1]."""
    q = np.asarray(q, dtype=float)
    return np.where((q >= 0) & (q <= 1), q, np.nan)
