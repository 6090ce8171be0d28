"""Distributions on the line that have a density: Gaussian (clipped, truncated or neither), uniform, log-uniform."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
import scipy

from segar.errors import PriorError
from segar.noise.base import LAST_QUANTILE, Noise, fraction, quadrature, set_fields
from segar.noise.checks import finite, interval

SIGMAS = 10  # a Gaussian is integrated this far to either side: beyond lies a mass of 1e-23
PANELS = 24  # into which a truncated one is cut for integrals
NARROW = 1e-8  # [std] an interval so short is as good as uniform; differences of masses would round
TAIL = 46.0  # an exponential tail is integrated over this many of its scales: beyond lies a mass of 1e-20


class GaussianBetween(Noise):
    """A Gaussian and two ends, which may be infinite; its sub-classes say what becomes of the mass beyond them."""

    loc: float
    std: float

    @property
    def _z(self) -> tuple[float, float]:
        """The ends in standard deviations from ``loc``."""
        return (self.support[0] - self.loc) / self.std, (self.support[1] - self.loc) / self.std

    def _set_gaussian(self, mean: float, std: float) -> None:
        finite(self, mean=mean, std=std)
        if not std > 0:
            raise PriorError(
                f"{type(self).__name__}: std must be positive, not {std!r}; for a constant give the value itself"
            )
        set_fields(self, loc=float(mean), std=float(std))


@dataclass(frozen=True, init=False, repr=False)
class GaussianNoise(GaussianBetween):
    """Gaussian with ``mean`` and standard deviation ``std``; ``clip=(low, high)`` moves draws outside to the ends.

    A clipped Gaussian has an atom at each end. ``loc`` is the parameter ``mean``; the property ``mean`` is the mean of
    the distribution, clipping included.
    """

    loc: float
    std: float
    clip: tuple[float, float] | None

    def __init__(self, mean: float = 0.0, std: float = 0.1, clip: Sequence[float] | None = None) -> None:
        self._set_gaussian(mean, std)
        object.__setattr__(self, "clip", None if clip is None else interval(self, "clip", clip))

    def sample(self, rng: Any, size: Any = None) -> Any:
        x = rng.normal(self.loc, self.std, size)
        return x if self.clip is None else np.clip(x, *self.clip)

    def cdf(self, x: Any) -> Any:
        low, high = self.support
        x = np.asarray(x, dtype=float)
        p = scipy.special.ndtr((x - self.loc) / self.std)
        return np.where(x < low, 0.0, np.where(x >= high, 1.0, p))[()]

    def pdf(self, x: Any) -> Any:
        low, high = self.support
        x = np.asarray(x, dtype=float)
        return np.where((x > low) & (x < high), gauss((x - self.loc) / self.std) / self.std, 0.0)[()]

    def icdf(self, q: Any) -> Any:
        return np.clip(self.loc + self.std * scipy.special.ndtri(np.asarray(q, dtype=float)), *self.support)[()]

    @property
    def mean(self) -> float:
        return self.loc + self.std * self._moments[0]

    @property
    def var(self) -> float:
        return self.std**2 * self._moments[1]

    @property
    def support(self) -> tuple[float, float]:
        return self.clip or (-math.inf, math.inf)

    @property
    def atoms(self) -> tuple[np.ndarray, np.ndarray]:
        low, high = self.support
        if low == high:
            return np.array([low]), np.ones(1)
        ends = [(x, scipy.special.ndtr(z)) for x, z in ((low, self._z[0]), (high, -self._z[1])) if math.isfinite(x)]
        return np.array([x for x, _ in ends]), np.array([mass for _, mass in ends])

    @property
    def pieces(self) -> np.ndarray:
        grid = self.loc + self.std * np.arange(-SIGMAS, SIGMAS + 1.0)
        return np.unique(np.clip(grid, *self.support))

    @cached_property
    def _moments(self) -> tuple[float, float]:
        """Mean and variance of (x - loc) / std; sums of what is positive, as differences lose short and far ranges."""
        if self.clip is None:
            return 0.0, 1.0
        inner, weight = quadrature((self.pieces - self.loc) / self.std)
        z = np.append(inner, (self.atoms[0] - self.loc) / self.std)
        mass = np.append(weight * gauss(inner), self.atoms[1])
        mean = float(mass @ z)
        return mean, float(mass @ (z - mean) ** 2)


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
        if self._is_narrow:
            return UniformNoise(*self.truncate).cdf(x)
        z = np.clip((np.asarray(x, dtype=float) - self.loc) / self.std, *self._z)
        return np.clip(self._mass_between(self._z[0], z) / self._mass, 0.0, 1.0)[()]

    def pdf(self, x: Any) -> Any:
        x = np.asarray(x, dtype=float)
        inside = (x >= self.truncate[0]) & (x <= self.truncate[1])
        return np.where(inside, gauss((x - self.loc) / self.std) / (self.std * self._mass), 0.0)[()]

    def icdf(self, q: Any) -> Any:
        q, low = fraction(q), self._z[0]
        if self._is_narrow:
            return UniformNoise(*self.truncate).icdf(q)
        if low <= 0:
            z = scipy.special.ndtri(np.minimum(scipy.special.ndtr(low) + q * self._mass, LAST_QUANTILE))
        else:
            z = -scipy.special.ndtri(scipy.special.ndtr(-low) - q * self._mass)
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

    @cached_property
    def _mass(self) -> float:
        """Mass of the whole Gaussian between the ends."""
        if self._is_narrow:
            return float(gauss(np.mean(self._z))) * (self._z[1] - self._z[0])
        return float(self._mass_between(*self._z))

    @property
    def _is_narrow(self) -> bool:
        return self._z[1] - self._z[0] < NARROW

    def _mass_between(self, low: Any, high: Any) -> Any:
        """Mass of the standard Gaussian between two points, both seen from the thinner tail."""
        if self._z[0] > 0:
            low, high = -np.asarray(high), -np.asarray(low)
        return scipy.special.ndtr(high) - scipy.special.ndtr(low)


@dataclass(frozen=True, repr=False)
class UniformNoise(Noise):
    """Uniform between ``low`` and ``high``."""

    low: float
    high: float

    def __post_init__(self) -> None:
        ends = interval(self, "its range", (self.low, self.high), strict=True)
        set_fields(self, low=ends[0], high=ends[1])

    def sample(self, rng: Any, size: Any = None) -> Any:
        return rng.uniform(self.low, self.high, size)

    def cdf(self, x: Any) -> Any:
        return np.clip((np.asarray(x, dtype=float) - self.low) / (self.high - self.low), 0.0, 1.0)[()]

    def pdf(self, x: Any) -> Any:
        x = np.asarray(x, dtype=float)
        return np.where((x >= self.low) & (x <= self.high), 1.0 / (self.high - self.low), 0.0)[()]

    def icdf(self, q: Any) -> Any:
        return (self.low + (self.high - self.low) * fraction(q))[()]

    @property
    def mean(self) -> float:
        return (self.low + self.high) / 2

    @property
    def var(self) -> float:
        return (self.high - self.low) ** 2 / 12

    @property
    def pieces(self) -> np.ndarray:
        return np.array([self.low, self.high])


@dataclass(frozen=True, repr=False)
class LogUniform(Noise):
    """The logarithm is uniform between ``log(low)`` and ``log(high)``."""

    low: float
    high: float

    def __post_init__(self) -> None:
        ends = interval(self, "its range", (self.low, self.high), strict=True)
        if not (ends[0] > 0 and math.isfinite(ends[1] / ends[0])):
            raise PriorError(
                f"LogUniform: low must be positive, and high / low finite, not {self.low!r} and {self.high!r}"
            )
        set_fields(self, low=ends[0], high=ends[1])

    def sample(self, rng: Any, size: Any = None) -> Any:
        return self.low * np.exp(self._span * rng.random(size))

    def cdf(self, x: Any) -> Any:
        x = np.clip(np.asarray(x, dtype=float), self.low, self.high)
        return (np.log(x / self.low) / self._span)[()]

    def pdf(self, x: Any) -> Any:
        x = np.asarray(x, dtype=float)
        inside = (x >= self.low) & (x <= self.high)
        return np.where(inside, 1.0 / (np.where(inside, x, 1.0) * self._span), 0.0)[()]

    def icdf(self, q: Any) -> Any:
        return (self.low * np.exp(self._span * fraction(q)))[()]

    @property
    def pieces(self) -> np.ndarray:
        return np.geomspace(self.low, self.high, max(2, math.ceil(self._span) + 1))

    @property
    def _span(self) -> float:
        return math.log(self.high / self.low)


def gauss(z: Any) -> Any:
    """Density of the standard Gaussian."""
    return np.exp(-0.5 * np.square(z)) / math.sqrt(2 * math.pi)
