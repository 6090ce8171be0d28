"""Wasserstein-2 and Kolmogorov-Smirnov distances on the line, and Wasserstein-2 and Kuiper's distance on the circle."""

import math
from collections.abc import Callable

import numpy as np
import scipy

from segar.noise.base import NODES, ROUNDING, Noise, quadrature, quantile_bends, quantile_nodes
from segar.noise.discrete import DiscreteNoise
from segar.noise.wrapped import Wrapped
from segar.support import Estimate, emd

ATOM_PAIRS = 4_000_000  # between which transport is solved exactly
KS_GRID = 512  # points per distribution where the difference of two distribution functions is looked at first
KS_REFINEMENTS = 40  # golden-section steps around the best of them
KS_CELLS = 200_000  # that are looked at, at most, to bound it
BISECTIONS = 60  # of a cell, at most, to bound it
TABLE = 2048  # quantiles from which the best place to cut two circles is found roughly
TURN_TOLERANCE = 1e-9  # of a turn, to which the best place to cut is searched
SEARCH_NODES = 6  # of quadrature per piece while searching


def w2_line(a: Noise, b: Noise) -> Estimate:
    """The Wasserstein-2 distance, and the change that half as many quadrature nodes make (0 for two sets of atoms)."""
    if isinstance(a, DiscreteNoise) and isinstance(b, DiscreteNoise):
        return Estimate(_integrated(a, b, 1))
    value = _integrated(a, b, NODES)
    return Estimate(value, abs(value - _integrated(a, b, NODES // 2)))


def ks_line(a: Noise, b: Noise) -> float:
    """The Kolmogorov-Smirnov distance of two distributions as distributions on the line, their periods left aside."""
    return max(greatest_difference(a, b), greatest_difference(b, a))


def greatest_difference(a: Noise, b: Noise) -> float:
    """The largest value of ``a.cdf - b.cdf`` that was found, on the line."""
    x = _ks_candidates(a, b)
    gap = a.cdf(x) - b.cdf(x)
    best = int(gap.argmax())
    if isinstance(a, DiscreteNoise) and isinstance(b, DiscreteNoise):
        return max(float(gap[best]), 0.0)
    low, high = x[max(best - 1, 0)], x[min(best + 1, len(x) - 1)]
    return max(float(gap[best]), _golden_maximum(lambda t: float(a.cdf(t) - b.cdf(t)), low, high), 0.0)


def supremum(a: Noise, b: Noise, tolerance: float) -> Estimate:
    """The supremum of ``a.cdf - b.cdf`` on the line, with a bound of its error.

    Distribution functions rise, so between two points their difference is at most a's value on the right minus b's on
    the left. Cells whose bound exceeds the best value by more than the tolerance are halved.
    """
    value, excess = greatest_difference(a, b), 0.0
    edges = np.unique(np.concatenate([[-np.inf], _ks_candidates(a, b), [np.inf]]))
    low, high = edges[:-1], edges[1:]
    for _ in range(BISECTIONS):
        bound = np.asarray(a.cdf(high)) - np.asarray(a.pmf(high)) - np.asarray(b.cdf(low))
        excess = max(0.0, float(bound.max()) - value)
        open_ = bound > value + tolerance
        if not open_.any() or open_.sum() > KS_CELLS:
            break
        low, high = low[open_], high[open_]
        middle = 0.5 * low + 0.5 * high
        value = max(value, float((a.cdf(middle) - b.cdf(middle)).max()))
        low, high = np.concatenate([low, middle]), np.concatenate([middle, high])
    return Estimate(value, excess)


def _integrated(a: Noise, b: Noise, nodes: int) -> float:
    """Root of the integral of the squared difference of the quantile functions; one node does where both are steps."""
    q, weight = quantile_nodes(a, b, nodes=nodes)
    return math.sqrt(float(weight @ (a.icdf(q) - b.icdf(q)) ** 2))


def _ks_candidates(a: Noise, b: Noise) -> np.ndarray:
    """Points at which the difference of the distribution functions may be largest, ascending."""
    q = np.linspace(0.0, 1.0, KS_GRID + 2)[1:-1]
    points = [one.pieces for one in (a, b)]
    points += [one.icdf(q) for one in (a, b) if not isinstance(one, DiscreteNoise)]
    points += [np.nextafter(one.atoms[0], -np.inf) for one in (a, b)]
    return np.unique(np.concatenate(points))


def _golden_maximum(f: Callable[[float], float], low: float, high: float) -> float:
    """The largest value of a function with one peak between ``low`` and ``high``, by golden sections."""
    ratio = (math.sqrt(5) - 1) / 2
    for _ in range(KS_REFINEMENTS):
        left, right = high - ratio * (high - low), low + ratio * (high - low)
        low, high = (left, high) if f(left) < f(right) else (low, right)
    return f(0.5 * (low + high))


def w2_on_circle(a: Noise, b: Noise, period: float) -> Estimate:
    """The Wasserstein-2 distance along the shorter arcs, and the change that half as many quadrature nodes make.

    It is the least distance on the line over all ways to cut both circles, a convex function of the mass between the
    cuts (Delon, Salomon and Sobolevskii 2010).
    """
    if a == b:
        return Estimate(0.0)
    (x, p), (y, q) = a.atoms, b.atoms
    if min(p.sum(), q.sum()) > 1 - ROUNDING and len(x) * len(y) <= ATOM_PAIRS:
        apart = x[:, None] - y
        return Estimate(math.sqrt(emd((apart - period * np.rint(apart / period)) ** 2, p, q)))
    a, b = (_within_a_turn(one, period) for one in (a, b))
    near = _least(_tabulated(a, b, period), -1.5, 1.5)
    reach, shift = 2 / TABLE, math.inf
    while abs(shift - near) > 0.9 * reach:  # the minimum lies outside of what was searched
        reach *= 4
        shift = _least(lambda cut: _square(a, b, period, cut, SEARCH_NODES), near - reach, near + reach)
    # For distributions that are alike the best shift is exactly 0: beside it, a tiny weight goes round the whole circle.
    shift = min((shift, float(round(shift))), key=lambda cut: _square(a, b, period, cut, SEARCH_NODES))
    fine, coarse = (math.sqrt(_square(a, b, period, shift, nodes)) for nodes in (NODES, NODES // 2))
    return Estimate(fine, abs(fine - coarse))


def _within_a_turn(distribution: Noise, period: float) -> Noise:
    """The distribution itself where one turn holds all of it, else the wrapped one."""
    low, high = distribution.support
    return distribution if high - low <= period * (1 + 1e-12) else Wrapped(distribution, period)


def _least(f: Callable[[float], float], low: float, high: float) -> float:
    """Where a convex function is least."""
    options = {"xatol": TURN_TOLERANCE}
    return float(scipy.optimize.minimize_scalar(f, bounds=(low, high), method="bounded", options=options).x)


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
