"""The Kolmogorov-Smirnov distance of two distributions on the line."""

import math
from collections.abc import Callable

import numpy as np

from segar.noise.base import Noise
from segar.noise.discrete import DiscreteNoise

KS_GRID = 512  # points per distribution where the difference of two distribution functions is looked at first
KS_REFINEMENTS = 40  # golden-section steps around the best of them


def ks_line(a: Noise, b: Noise) -> float:
    """The Kolmogorov-Smirnov distance of two distributions on the line, whose ends are not joined where they are angles."""
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
