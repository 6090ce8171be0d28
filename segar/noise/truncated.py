"""A Gaussian that is drawn again until it falls between two ends: no atoms, unlike a clipped one."""

import math
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from segar.errors import PriorError
from segar.noise.base import fraction, moments
from segar.noise.checks import interval
from segar.noise.continuous import SIGMAS, GaussianBetween, gauss, gauss_cdf, gauss_quantile

PANELS = 24  # into which the line is cut for integrals, at most
TAIL = 46.0  # an exponential tail is integrated over this many of its scales: beyond lies a mass of 1e-20


@dataclass(frozen=True, init=False, repr=False)
class TruncatedGaussianNoise(GaussianBetween):
    """Gaussian with ``mean`` and standard deviation ``std`` given that it lies in ``truncate=(low, high)``.

    ``loc`` is the parameter ``mean``; the property ``mean`` is the mean of the
    distribution. An end may be infinite. Draws are made by inversion, which is precise in the tails up to 37 standard
    deviations, where double precision no longer resolves the tail's mass.
    """

    loc: float
    std: float
    truncate: tuple[float, float]

    def __init__(self, mean: float, std: float, truncate: Any) -> None:
        self._set_gaussian(mean, std)
        low, high = interval(self, "truncate", truncate)
        object.__setattr__(self, "truncate", (low, high))
        if not self._mass > 0:
            raise PriorError(f"{self!r}: no mass lies in ({low:g}, {high:g}); widen the interval, or move the mean")

    def sample(self, rng: Any, size: Any = None) -> Any:
        return self.icdf(rng.random(size))

    def cdf(self, x: Any) -> Any:
        z = np.clip((np.asarray(x, dtype=float) - self.loc) / self.std, *self._z)
        return np.clip(self._mass_between(self._z[0], z) / self._mass, 0.0, 1.0)[()]

    def pdf(self, x: Any) -> Any:
        x = np.asarray(x, dtype=float)
        inside = (x >= self.truncate[0]) & (x <= self.truncate[1])
        return np.where(inside, gauss((x - self.loc) / self.std) / (self.std * self._mass), 0.0)[()]

    def icdf(self, q: Any) -> Any:
        q, low = fraction(q), self._z[0]
        if low <= 0:
            z = gauss_quantile(gauss_cdf(low) + q * self._mass)
        else:
            z = -gauss_quantile(gauss_cdf(-low) - q * self._mass)
        z = np.where(q == 0, low, np.where(q == 1, self._z[1], z))
        return np.clip(self.loc + self.std * z, *self.truncate)[()]

    @property
    def support(self) -> tuple[float, float]:
        return self.truncate

    @property
    def pieces(self) -> np.ndarray:
        low, high = self._z
        first = low if low > -SIGMAS else -SIGMAS
        last = high if high < SIGMAS else SIGMAS
        if low > 0:
            last = min(high, low + min(SIGMAS, TAIL / low))
        if high < 0:
            first = max(low, high - min(SIGMAS, -TAIL / high))
        return np.clip(self.loc + self.std * np.linspace(first, last, PANELS + 1), *self.truncate)

    def entropy(self) -> float:
        mean, var = self._moments
        return math.log(self.std * math.sqrt(2 * math.pi)) + math.log(self._mass) + (var + mean**2) / 2

    @cached_property
    def _mass(self) -> float:
        """Mass of the whole Gaussian between the ends."""
        return float(self._mass_between(*self._z))

    @cached_property
    def _moments(self) -> tuple[float, float]:  # type: ignore[override]
        low, high = self._z
        if max(abs(low), abs(high)) < math.inf or min(abs(low), abs(high)) > SIGMAS / 2:
            # The closed form loses digits in tails and in narrow intervals.
            mean, var = moments(self)
            return (mean - self.loc) / self.std, var / self.std**2
        edge = [0.0 if math.isinf(z) else z * float(gauss(z)) for z in (low, high)]
        mean = float(gauss(low) - gauss(high)) / self._mass
        return mean, 1.0 + (edge[0] - edge[1]) / self._mass - mean**2

    def _mass_between(self, low: Any, high: Any) -> Any:
        """Mass of the standard Gaussian between two points, both seen from the thinner tail."""
        if self._z[0] > 0:
            low, high = -np.asarray(high), -np.asarray(low)
        return gauss_cdf(high) - gauss_cdf(low)
