"""Distributions on a circle, such as those of angles: one on the line that is wrapped."""

import math
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from segar.errors import PriorError
from segar.noise.base import Noise, joined_atoms
from segar.noise.checks import finite


@dataclass(frozen=True, repr=False)
class Wrapped(Noise):
    """The place on a circle that a number has: x modulo ``period``, in ``[-period / 2, period / 2)``.

    ``law`` is any distribution on the line; an angle [rad] has the period 2 pi. Mean and variance are those of the number.

    >>> angle = segar.noise.Wrapped(segar.GaussianNoise(0.0, 10.0))
    >>> bool(abs(angle.sample(np.random.default_rng(0))) <= np.pi)
    True
    """

    law: Noise
    period: float = math.tau

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
        return np.unique(np.concatenate([[-half, half], wrap(self.law.pieces, self.period)]))

    @property
    def support(self) -> tuple[float, float]:
        return -self.period / 2, self.period / 2

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
        low, high = self.law.pieces[0], self.law.pieces[-1]
        return np.arange(round(low / self.period), round(high / self.period) + 1.0)


def wrap(x: Any, period: float) -> Any:
    """``x`` modulo ``period``, as a number in ``[-period / 2, period / 2)``."""
    half = period / 2
    wrapped = np.mod(np.asarray(x, dtype=float) + half, period) - half
    return np.where(wrapped >= half, -half, wrapped)[()]  # a number that is only a rounding below the cut
