"""Wasserstein-2 and Kolmogorov-Smirnov distances of distributions on the line, where they have no closed form."""

import math
from collections.abc import Callable

import numpy as np

from segar.noise.base import NODES, Noise, quantile_nodes
from segar.noise.discrete import DiscreteNoise
from segar.support import Estimate

KS_GRID = 512  # points per distribution where the difference of two distribution functions is looked at first
KS_REFINEMENTS = 40  # golden-section steps around the best of them
KS_TOLERANCE = 1e-6  # to which the Kolmogorov-Smirnov distance is bounded
KS_CELLS = 200_000  # that are looked at, at most, to bound it
BISECTIONS = 60  # of a cell, at most, to bound it


def w2_line(a: Noise, b: Noise) -> Estimate:
    """The Wasserstein-2 distance, and the change that half as many quadrature nodes make (0 for two sets of atoms)."""
    if isinstance(a, DiscreteNoise) and isinstance(b, DiscreteNoise):
        return Estimate(_integrated(a, b, 1))
    value = _integrated(a, b, NODES)
    return Estimate(value, abs(value - _integrated(a, b, NODES // 2)))


def ks_line(a: Noise, b: Noise) -> float:
    """The Kolmogorov-Smirnov distance of two distributions as distributions on the line, their periods left aside."""
    return max(greatest_difference(a, b), greatest_difference(b, a))


def ks_line_estimate(a: Noise, b: Noise) -> Estimate:
    """``ks_line`` and a bound of its error, at most 1e-6 unless the difference is flat."""
    sides = supremum(a, b), supremum(b, a)
    value = max(side.value for side in sides)
    return Estimate(value, max(side.value + side.error for side in sides) - value)


def greatest_difference(a: Noise, b: Noise) -> float:
    """The largest value of ``a.cdf - b.cdf`` that was found, on the line."""
    x = _ks_candidates(a, b)
    gap = a.cdf(x) - b.cdf(x)
    best = int(gap.argmax())
    if isinstance(a, DiscreteNoise) and isinstance(b, DiscreteNoise):
        return max(float(gap[best]), 0.0)
    low, high = x[max(best - 1, 0)], x[min(best + 1, len(x) - 1)]
    return max(float(gap[best]), _golden_maximum(lambda t: float(a.cdf(t) - b.cdf(t)), low, high), 0.0)


def supremum(a: Noise, b: Noise, tolerance: float = KS_TOLERANCE) -> Estimate:
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
