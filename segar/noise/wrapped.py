"""Distributions on a circle, such as those of angles: one on the line that is wrapped, and that of von Mises."""

import math
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from typing import Any

import numpy as np
import scipy

from segar.errors import PriorError
from segar.noise.base import Noise, fraction, gauss_legendre, joined_atoms, set_fields
from segar.noise.checks import finite
from segar.support import read_only

SIGMAS = 10  # pieces of one standard deviation, to either side of the mean, before the rest in one piece
CDF_NODES = 16  # of Gauss-Legendre quadrature within a piece: errors below 1e-14
MOST_TURNS = 10_000  # over which densities and masses are summed
TABLE = 32  # points per piece from which a quantile is first read
NEWTON_STEPS = 3  # that make it exact to rounding


@dataclass(frozen=True, repr=False)
class Wrapped(Noise):
    """The place on a circle that a number has: x modulo ``period``, in ``[-period / 2, period / 2)``.

    ``law`` is any distribution on the line; an angle [rad] has the period 2 pi. Mean and variance are those of the number.

    >>> angle = segar.noise.Wrapped(segar.GaussianNoise(0.0, 10.0))
    >>> bool(abs(angle.sample(np.random.default_rng(0))) <= np.pi)
    True
    """

    law: Noise
    period: float = math.tau  # type: ignore[assignment]

    def __post_init__(self) -> None:
        if not isinstance(self.law, Noise) or self.law.width != 1:
            raise PriorError(f"Wrapped needs a distribution on the line, not {self.law!r}")
        finite(self, period=self.period)
        if not self.period > 0:
            raise PriorError(f"Wrapped: the period must be positive, not {self.period!r}")
        object.__setattr__(self, "period", float(self.period))

    def sample(self, rng: Any, size: Any = None) -> Any:
        return wrap(self.law.sample(rng, size), self.period)

    def cdf(self, x: Any) -> Any:
        half = self.period / 2
        x = np.asarray(x, dtype=float)
        inside = np.clip(x, -half, half)
        below = self._smooth(inside[..., None] + self.period * self._turns).sum(axis=-1) - self._before
        values, masses = self.atoms  # apart, since wrapping rounds, and an atom lies at one number only
        below = below + np.concatenate([[0.0], np.cumsum(masses)])[np.searchsorted(values, inside, side="right")]
        return np.where(x < -half, 0.0, np.where(x >= half, 1.0, np.clip(below, 0.0, 1.0)))[()]

    def pdf(self, x: Any) -> Any:
        half = self.period / 2
        x = np.asarray(x, dtype=float)
        density = np.asarray(self.law.pdf(x[..., None] + self.period * self._turns)).sum(axis=-1)
        return np.where(np.abs(x) <= half, density, 0.0)[()]

    @cached_property
    def atoms(self) -> tuple[np.ndarray, np.ndarray]:  # type: ignore[override]
        values, masses = self.law.atoms
        return joined_atoms(wrap(values, self.period), masses)

    @cached_property
    def pieces(self) -> np.ndarray:  # type: ignore[override]
        half = self.period / 2
        return read_only(np.unique(np.concatenate([[-half, half], wrap(self.law.pieces, self.period)])))

    def _smooth(self, x: Any) -> np.ndarray:
        """The mass of the unwrapped distribution up to ``x`` that is not in atoms."""
        values, masses = self.law.atoms
        below = np.concatenate([[0.0], np.cumsum(masses)])[np.searchsorted(values, x, side="right")]
        return np.asarray(self.law.cdf(x)) - below

    @cached_property
    def _before(self) -> float:
        """The sum over turns of the mass without atoms below the beginning of each turn."""
        return float(self._smooth(self.period * (self._turns - 0.5)).sum())

    @cached_property
    def _turns(self) -> np.ndarray:
        """The turns in which the distribution has mass, as numbers of periods away from the middle one."""
        first, last = np.rint(self.law.pieces[[0, -1]] / self.period)
        if not last - first < MOST_TURNS:
            raise PriorError(
                f"{self!r} goes round its circle {last - first:.0f} times; measures take {MOST_TURNS} at most"
            )
        return np.arange(first, last + 1)


def wrap(x: Any, period: float) -> Any:
    """``x`` modulo ``period``, as a number in ``[-period / 2, period / 2)``."""
    half = period / 2
    wrapped = np.mod(np.asarray(x, dtype=float) + half, period) - half
    return np.where(wrapped >= half, -half, wrapped)[()]  # a number that is only a rounding below the cut


@dataclass(frozen=True, init=False, repr=False)
class VonMises(Noise):
    """An angle [rad] in ``[mean - pi, mean + pi]`` with density proportional to ``exp(kappa cos(x - mean))``.

    The larger ``kappa`` (positive), the narrower; ``UniformNoise(-pi, pi)`` is the distribution with kappa 0. Mean and variance
    are those of the number, distances those on the circle. ``loc`` is the parameter ``mean``.
    """

    loc: float
    kappa: float
    period = math.tau  # type: ignore[assignment]

    def __init__(self, mean: float = 0.0, kappa: float = 1.0) -> None:
        finite(self, mean=mean, kappa=kappa)
        if not kappa > 0:
            raise PriorError(f"VonMises: kappa must be positive, not {kappa!r}; UniformNoise(-pi, pi) has no direction")
        set_fields(self, loc=float(mean), kappa=float(kappa))

    def sample(self, rng: Any, size: Any = None) -> Any:
        return self.icdf(rng.random(size))

    def pdf(self, x: Any) -> Any:
        z = np.asarray(x, dtype=float) - self.loc
        return np.where(np.abs(z) <= math.pi, self._density(z), 0.0)[()]

    def cdf(self, x: Any) -> Any:
        return self._below(np.clip(np.asarray(x, dtype=float) - self.loc, -math.pi, math.pi))[()]

    def icdf(self, q: Any) -> Any:
        q = fraction(q)
        table, level = self._table
        right = np.clip(np.searchsorted(level, q), 1, len(table) - 1)
        low, high = table[right - 1], table[right]
        z = np.interp(q, level, table)
        for _ in range(NEWTON_STEPS):
            density = self._density(z)
            step = np.divide(self._below(z) - q, density, out=np.zeros_like(density), where=density > 0)
            z = np.clip(z - step, low, high)
        return (self.loc + np.where(q == 0, -math.pi, np.where(q == 1, math.pi, z)))[()]

    @property
    def mean(self) -> float:
        return self.loc

    @property
    def pieces(self) -> np.ndarray:
        return self.loc + self._pieces

    @cached_property
    def _pieces(self) -> np.ndarray:
        grid = np.arange(-SIGMAS, SIGMAS + 1.0) / max(1.0, math.sqrt(self.kappa))
        return np.unique([-math.pi, *grid[np.abs(grid) < math.pi], math.pi])

    @cached_property
    def _cumulated(self) -> np.ndarray:
        """Mass below each of the pieces' ends."""
        edges = self._pieces
        mass = np.array([self._mass(a, np.array(b)) for a, b in pairwise(edges)])
        return np.concatenate([[0.0], np.cumsum(mass)])

    @cached_property
    def _table(self) -> tuple[np.ndarray, np.ndarray]:
        edges = self._pieces
        inner = edges[:-1, None] + np.diff(edges)[:, None] * np.arange(TABLE) / TABLE
        points = np.append(inner.ravel(), math.pi)
        return points, self._below(points)

    def _below(self, z: np.ndarray) -> np.ndarray:
        """Mass between -pi and ``z``."""
        piece = np.clip(np.searchsorted(self._pieces, z, side="right") - 1, 0, len(self._pieces) - 2)
        return np.clip(self._cumulated[piece] + self._mass(self._pieces[piece], z), 0.0, 1.0)

    def _mass(self, low: Any, high: np.ndarray) -> np.ndarray:
        nodes, weights = gauss_legendre(CDF_NODES)
        half, middle = (high - low) / 2, (high + low) / 2
        return sum(w * self._density(middle + half * t) for t, w in zip(nodes, weights, strict=True)) * half

    def _density(self, z: Any) -> Any:
        # kappa (cos z - 1), without the cancellation at small z
        return np.exp(-2 * self.kappa * np.sin(0.5 * z) ** 2) / (2 * math.pi * scipy.special.i0e(self.kappa))
