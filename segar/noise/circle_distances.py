"""Wasserstein-2 and Kuiper's distance of distributions on a circle."""

import math
from collections.abc import Callable

import numpy as np

from segar.noise.base import NODES, Noise, quadrature, quantile_bends
from segar.noise.discrete import DiscreteNoise
from segar.noise.line_distances import greatest_difference, supremum
from segar.noise.wrapped import Wrapped
from segar.support import Estimate

TABLE = 2048  # quantiles from which the best place to cut two circles is found roughly
GOLDEN_STEPS = 60  # to 1e-12 of a turn
FINE_STEPS = 28  # around what the tables say: to 1e-8 of a turn
SEARCH_NODES = 6  # of quadrature per piece while searching


def w2_on_circle(a: Noise, b: Noise, period: float) -> Estimate:
    """The Wasserstein-2 distance along the shorter arcs, and the change that half as many quadrature nodes make.

    It is the least distance on the line over all ways to cut both circles, a convex function of the mass between the
    cuts (Delon, Salomon and Sobolevskii 2010).
    """
    if a == b:
        return Estimate(0.0)
    a, b = (_within_a_turn(one, period) for one in (a, b))
    if isinstance(a, DiscreteNoise) and isinstance(b, DiscreteNoise):
        _, square = _least(lambda shift: _square(a, b, period, shift, 1), -1.5, 1.5, GOLDEN_STEPS)
        return Estimate(math.sqrt(square))
    near, _ = _least(_tabulated(a, b, period), -1.5, 1.5, GOLDEN_STEPS)
    reach, shift = 2 / TABLE, math.inf
    while abs(shift - near) > 0.9 * reach:  # the minimum lies outside of what was searched
        reach *= 4
        shift, _ = _least(lambda cut: _square(a, b, period, cut, SEARCH_NODES), near - reach, near + reach, FINE_STEPS)
    # For distributions that are alike the best shift is exactly 0: beside it, a tiny weight goes round the whole circle.
    shift = min((shift, float(round(shift))), key=lambda cut: _square(a, b, period, cut, SEARCH_NODES))
    fine, coarse = (math.sqrt(_square(a, b, period, shift, nodes)) for nodes in (NODES, NODES // 2))
    return Estimate(fine, abs(fine - coarse))


def ks_on_circle(a: Noise, b: Noise, period: float) -> float:
    """Kuiper's distance: the largest difference of the masses of an arc. It does not depend on where the circle is cut."""
    a, b = Wrapped(a, period), Wrapped(b, period)
    return greatest_difference(a, b) + greatest_difference(b, a)


def ks_estimate_on_circle(a: Noise, b: Noise, period: float) -> Estimate:
    """``ks_on_circle`` and a bound of its error."""
    a, b = Wrapped(a, period), Wrapped(b, period)
    one, other = supremum(a, b), supremum(b, a)
    return Estimate(one.value + other.value, one.error + other.error)


def _within_a_turn(distribution: Noise, period: float) -> Noise:
    """The distribution itself where one turn holds all of it, else the wrapped one."""
    low, high = distribution.support
    return distribution if high - low <= period * (1 + 1e-12) else Wrapped(distribution, period)


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
    edges = [np.array([0.0, 1.0]), quantile_bends(a), np.mod(quantile_bends(b) - shift, 1.0)]
    q, weight = quadrature(np.unique(np.concatenate(edges)), nodes)
    turns = np.floor(q + shift)
    there = b.icdf(np.clip(q + shift - turns, 0.0, 1.0)) + period * turns + _whole_turns(a, b, period)
    return float(weight @ (a.icdf(q) - there) ** 2)


def _whole_turns(a: Noise, b: Noise, period: float) -> float:
    """The shift by whole periods that brings b's support nearest to a's."""
    return period * round((a.support[0] - b.support[0]) / period)
