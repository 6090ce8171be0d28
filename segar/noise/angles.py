"""The distribution of von Mises, for angles."""

import math
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from typing import Any

import numpy as np
import scipy

from segar.errors import PriorError
from segar.noise.base import Noise, fraction, gauss_legendre, set_fields
from segar.noise.checks import finite

SIGMAS = 10  # pieces of one standard deviation, to either side of the mean, before the rest in one piece
CDF_NODES = 16  # of Gauss-Legendre quadrature within a piece: errors below 1e-14
TABLE = 32  # points per piece from which a quantile is first read
NEWTON_STEPS = 3  # that make it exact to rounding


@dataclass(frozen=True, init=False, repr=False)
class VonMises(Noise):
    """An angle [rad] in ``[mean - pi, mean + pi]`` with density proportional to ``exp(kappa cos(x - mean))``.

    The larger ``kappa`` (positive), the narrower; ``UniformNoise(-pi, pi)`` is the distribution with kappa 0. Mean and variance
    are those of the number, distances those on the circle; ``resultant`` is the length of the mean direction.
    ``loc`` is the parameter ``mean``.
    """

    loc: float
    kappa: float

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
    def period(self) -> float:
        return math.tau

    @property
    def resultant(self) -> float:
        """Length of the mean of ``(cos x, sin x)``: 1 for a certain direction, 0 for none."""
        return float(scipy.special.i1e(self.kappa) / scipy.special.i0e(self.kappa))

    @property
    def support(self) -> tuple[float, float]:
        return self.loc - math.pi, self.loc + math.pi

    @property
    def pieces(self) -> np.ndarray:
        return self.loc + self._pieces

    def entropy(self) -> float:
        return math.log(2 * math.pi * scipy.special.i0e(self.kappa)) + self.kappa * (1.0 - self.resultant)

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
