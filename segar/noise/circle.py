"""Laws of what comes round again, such as angles: wrapped ones, and distances on the circle."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from segar.errors import PriorError
from segar.noise.base import Noise, finite
from segar.noise.discrete import DiscreteNoise
from segar.noise.measures import NODES, greatest_difference, quadrature, supremum
from segar.support import Estimate

TABLE = 2048  # quantiles from which the best place to cut two circles is found roughly
GOLDEN_STEPS = 60  # to 1e-12 of a turn
FINE_STEPS = 28  # around what the tables say: to 1e-8 of a turn
SEARCH_NODES = 6  # of quadrature per piece while searching


@dataclass(frozen=True, repr=False)
class Wrapped(Noise):
    """The law of the place on a circle that a number has: x modulo ``period``, as ``[-period / 2, period / 2)``.

    ``law`` is any law on the line; an angle [rad] has the period 2 pi. Mean and variance are those of the number.
    """

    law: Noise
    period: float = math.tau  # type: ignore[assignment]

    def __post_init__(self) -> None:
        if not isinstance(self.law, Noise) or self.law.width != 1:
            raise PriorError(f"Wrapped needs a law on the line, not {self.law!r}")
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
        values, masses = self.atoms  # apart: wrapping rounds, and an atom is found at its own number only
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
        places, owner = np.unique(wrap(values, self.period), return_inverse=True)
        return places, np.bincount(owner.ravel(), masses, len(places))

    @cached_property
    def pieces(self) -> np.ndarray:  # type: ignore[override]
        half = self.period / 2
        return np.unique(np.concatenate([[-half, half], wrap(self.law.pieces, self.period)]))

    @property
    def support(self) -> tuple[float, float]:
        return -self.period / 2, self.period / 2

    def _smooth(self, x: Any) -> np.ndarray:
        """The mass of the unwrapped law up to ``x`` that is not in atoms."""
        values, masses = self.law.atoms
        below = np.concatenate([[0.0], np.cumsum(masses)])[np.searchsorted(values, x, side="right")]
        return np.asarray(self.law.cdf(x)) - below

    @cached_property
    def _before(self) -> float:
        """The mass of that kind below the turns' beginnings, summed."""
        return float(self._smooth(self.period * (self._turns - 0.5)).sum())

    @cached_property
    def _turns(self) -> np.ndarray:
        """How many periods away from the middle one the law has mass."""
        low, high = self.law.pieces[0], self.law.pieces[-1]
        return np.arange(round(low / self.period), round(high / self.period) + 1.0)


def wrap(x: Any, period: float) -> Any:
    """``x`` modulo ``period``, as a number in ``[-period / 2, period / 2)``."""
    half = period / 2
    wrapped = np.mod(np.asarray(x, dtype=float) + half, period) - half
    return np.where(wrapped >= half, -half, wrapped)[()]  # what is a rounding below the cut


def common_period(a: Noise, b: Noise) -> float | None:
    """The period of two laws of which at least one has one; None on the line.

    Raises:
        PriorError: they have different ones.
    """
    periods = [law.period for law in (a, b) if law.period is not None]
    if len(set(periods)) > 1:
        raise PriorError(
            f"{a!r} and {b!r} have the periods {periods[0]:g} and {periods[1]:g}: they live on different circles"
        )
    return periods[0] if periods else None


def w2_on_circle(a: Noise, b: Noise, period: float) -> Estimate:
    """The Wasserstein-2 distance, way being measured along the shorter arc; and what half as many nodes would change.

    The least, over where both circles are cut, of the distance on the line (Delon, Salomon and Sobolevskii 2010): a
    convex function of the mass between the cuts.
    """
    if a == b:
        return Estimate(0.0)
    a, b = (_within_a_turn(law, period) for law in (a, b))
    if isinstance(a, DiscreteNoise) and isinstance(b, DiscreteNoise):
        _, square = _least(lambda shift: _square(a, b, period, shift, 1), -1.5, 1.5, GOLDEN_STEPS)
        return Estimate(math.sqrt(square))
    near, _ = _least(_tabulated(a, b, period), -1.5, 1.5, GOLDEN_STEPS)
    reach, shift = 2 / TABLE, math.inf
    while abs(shift - near) > 0.9 * reach:  # the tables missed it by more
        reach *= 4
        shift, _ = _least(lambda cut: _square(a, b, period, cut, SEARCH_NODES), near - reach, near + reach, FINE_STEPS)
    # Laws that are alike want no shift at all, to the bit: next to it, all mass goes round the circle with tiny weight.
    shift = min((shift, float(round(shift))), key=lambda cut: _square(a, b, period, cut, SEARCH_NODES))
    fine, coarse = (math.sqrt(_square(a, b, period, shift, nodes)) for nodes in (NODES, NODES // 2))
    return Estimate(fine, abs(fine - coarse))


def ks_on_circle(a: Noise, b: Noise, period: float) -> float:
    """Kuiper's distance: the largest difference of the masses of an arc, which does not depend on where a circle is cut."""
    a, b = Wrapped(a, period), Wrapped(b, period)
    return greatest_difference(a, b) + greatest_difference(b, a)


def ks_estimate_on_circle(a: Noise, b: Noise, period: float) -> Estimate:
    """``ks_on_circle`` and a bound of its error."""
    a, b = Wrapped(a, period), Wrapped(b, period)
    one, other = supremum(a, b), supremum(b, a)
    return Estimate(one.value + other.value, one.error + other.error)


def _within_a_turn(law: Noise, period: float) -> Noise:
    """The law itself where one turn holds all of it, else wrapped."""
    low, high = law.support
    return law if high - low <= period * (1 + 1e-12) else Wrapped(law, period)


def _least(f: Callable[[float], float], low: float, high: float, steps: int) -> tuple[float, float]:
    """Where a convex function is least, and its value there, by golden sections."""
    ratio = (math.sqrt(5) - 1) / 2
    left, right = high - ratio * (high - low), low + ratio * (high - low)
    at_left, at_right = f(left), f(right)
    for _ in range(steps):
        if at_left < at_right:
            high, right, at_right = right, left, at_left
            left = high - ratio * (high - low)
            at_left = f(left)
        else:
            low, left, at_left = left, right, at_right
            right = low + ratio * (high - low)
            at_right = f(right)
    return (left, at_left) if at_left < at_right else (right, at_right)


def _tabulated(a: Noise, b: Noise, period: float) -> Callable[[float], float]:
    """``_square`` from tables of the quantile functions."""
    q = (np.arange(TABLE) + 0.5) / TABLE
    x, y = a.icdf(q), b.icdf(q) + _whole_turns(a, b, period)
    places = np.concatenate([q - 2, q - 1, q, q + 1, q + 2])
    rolled = np.concatenate([y + period * turn for turn in (-2, -1, 0, 1, 2)])
    return lambda shift: float(np.mean((x - np.interp(q + shift, places, rolled)) ** 2))


def _square(a: Noise, b: Noise, period: float, shift: float, nodes: int) -> float:
    """The integral of (A(q) - B(q + shift))^2 over a turn, where quantile functions go on as Q(q + 1) = Q(q) + period."""
    edges = [np.array([0.0, 1.0]), _levels(a), np.mod(_levels(b) - shift, 1.0)]
    q, weight = quadrature(np.unique(np.concatenate(edges)), nodes)
    turns = np.floor(q + shift)
    there = b.icdf(np.clip(q + shift - turns, 0.0, 1.0)) + period * turns + _whole_turns(a, b, period)
    return float(weight @ (a.icdf(q) - there) ** 2)


def _whole_turns(a: Noise, b: Noise, period: float) -> float:
    """What brings b nearest to a without turning it."""
    return period * round((a.support[0] - b.support[0]) / period)


def _levels(law: Noise) -> np.ndarray:
    """The probabilities at which a quantile function may bend or jump."""
    p = np.asarray(law.cdf(law.pieces), dtype=float)
    return np.clip(np.concatenate([p, p - law.pmf(law.pieces)]), 0.0, 1.0)
