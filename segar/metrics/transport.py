"""Optimal transport on cost matrices and between small point sets; POT and scipy do the solving."""

import math
from collections.abc import Callable
from itertools import permutations

import numpy as np
import scipy
from scipy.spatial.distance import cdist, pdist, squareform

from segar.levels import PointSets
from segar.metrics.points import shorter_way
from segar.support import emd

FEW_MATCHINGS = 24
"""Up to so many ways to match two sets, all are tried at once over all pairs of levels; beyond, scipy solves each pair."""


def matching_costs(a: PointSets, b: PointSets, mismatch: float) -> np.ndarray:
    """Squared distance of every pair of levels by the best partial matching of their points, float64 ``[n, m]``.

    min over partial matchings of  sum_(matched) |x - y|^2 + mismatch^2 * (number of points left over on both sides):
    the generalised optimal sub-pattern assignment metric with p = 2, alpha = 2 and cut-off sqrt(2) mismatch, whose root
    is a metric on finite sets (Rahmathullah, Garcia-Fernandez and Svensson 2017, eq. 1 and proposition 1). Sets of one
    size that lie closer than the cut-off are at their squared Wasserstein-2 distance as counting measures.
    """

    def cost(x: np.ndarray, y: np.ndarray) -> np.ndarray:
        pairs = np.minimum(_squared_distances(x, y, a.periods), 2 * mismatch**2)
        return _best_matchings(pairs) + mismatch**2 * abs(x.shape[1] - y.shape[1])

    return _pair_costs(a, b, cost)


def balanced_costs(a: PointSets, b: PointSets, absent: float) -> np.ndarray:
    """Squared Wasserstein-2 distance of every pair of levels, as uniform measures on their points, float64 ``[n, m]``.

    W2^2 = min over couplings of E|x - y|^2; ``absent`` where just one of the two has no point, 0 where both have none.
    """

    def cost(x: np.ndarray, y: np.ndarray) -> np.ndarray:
        squares = _squared_distances(x, y, a.periods)
        if x.shape[1] == y.shape[1]:
            return _best_matchings(squares) / x.shape[1]
        return np.array([[emd(pair) for pair in row] for row in squares])

    return _pair_costs(a, b, cost, absent)


def sliced_costs(a: PointSets, b: PointSets, projections: np.ndarray, absent: float) -> np.ndarray:
    """Squared sliced Wasserstein-2 distance of every pair of levels, float64 ``[n, m]``.

    SW2^2 = mean over directions of the integral of (F^-1(q) - G^-1(q))^2 dq (Bonneel et al. 2015). On a direction the
    quantile functions are the sorted projections, constant between multiples of 1/k and 1/m; taken at these steps and
    weighted by the roots of their widths, they make squared Euclidean distances of all pairs at once.

    Args:
        projections: unit vectors as columns, float64 ``[dimension, directions]``.
        absent: cost where just one of the two has no point; both without a point cost 0.
    """

    def cost(x: np.ndarray, y: np.ndarray) -> np.ndarray:
        rows, columns, widths = quantile_steps(x.shape[1], y.shape[1])
        weights = np.sqrt(widths / projections.shape[1])[:, None]
        sorted_x = np.sort(x @ projections, axis=1)[:, rows] * weights
        sorted_y = np.sort(y @ projections, axis=1)[:, columns] * weights
        return cdist(sorted_x.reshape(len(x), -1), sorted_y.reshape(len(y), -1), "sqeuclidean")

    return _pair_costs(a, b, cost, absent)


def quantile_steps(k: int, m: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Between which of ``k`` and of ``m`` ascending points the optimal plan on the line moves mass, int64, and how much."""
    steps = np.union1d(np.arange(0, k * m + 1, m), np.arange(0, k * m + 1, k))  # in units of 1 / (k m)
    return steps[:-1] // m, steps[:-1] // k, np.diff(steps) / (k * m)


def _pair_costs(
    a: PointSets, b: PointSets, cost: Callable[[np.ndarray, np.ndarray], np.ndarray], absent: float | None = None
) -> np.ndarray:
    """The cost of every pair of levels, float64 ``[n, m]``; ``cost`` is asked once for each two numbers of points.

    Args:
        cost: of points ``[levels, points, dimension]`` of both sides, float64 ``[levels, levels]``.
        absent: cost where just one of the two has no point; both without a point cost 0. None: ``cost`` knows.
    """
    costs = np.empty((len(a.counts), len(b.counts)))
    for k in np.unique(a.counts):
        levels_a, points_a = a.with_count(k)
        for m in np.unique(b.counts):
            levels_b, points_b = b.with_count(m)
            if absent is None or min(k, m) > 0:
                costs[np.ix_(levels_a, levels_b)] = cost(points_a, points_b)
            else:
                costs[np.ix_(levels_a, levels_b)] = 0.0 if k == m else absent
    return costs


def _squared_distances(points_a: np.ndarray, points_b: np.ndarray, periods: np.ndarray | None) -> np.ndarray:
    """``|x - y|^2`` for all pairs of levels and of their points, float64 ``[n, m, points of a, points of b]``; the shorter
    way round in components that have a period."""
    (n, k, d), (m, j, _) = points_a.shape, points_b.shape
    flat = squares_between(points_a.reshape(n * k, d), points_b.reshape(m * j, d), periods)
    return flat.reshape(n, k, m, j).transpose(0, 2, 1, 3)


def squares_between(x: np.ndarray, y: np.ndarray, periods: np.ndarray | None) -> np.ndarray:
    """``|x - y|^2`` for all rows of two arrays, float64 ``[n, m]``; the shorter way round in columns that have a period, and
    half the work where both are one array."""
    periods = np.full(x.shape[1], np.inf) if periods is None else periods
    straight = np.isinf(periods)
    a, b = x[:, straight], y[:, straight]
    squares = squareform(pdist(a, "sqeuclidean")) if x is y else cdist(a, b, "sqeuclidean")
    for c in np.flatnonzero(~straight):
        squares += shorter_way((x[:, c, None] - y[None, :, c])[..., None], periods[c : c + 1])[..., 0] ** 2
    return squares


def _best_matchings(pairs: np.ndarray) -> np.ndarray:
    """Least sum of ``pairs[i, j]`` over matchings that exhaust the smaller side, for ``pairs [n, m, k, j]`` -> ``[n, m]``."""
    n, m, k, j = pairs.shape
    if k > j:
        pairs, k, j = pairs.swapaxes(2, 3), j, k
    if math.perm(j, k) <= FEW_MATCHINGS:
        best = np.full((n, m), np.inf)
        for chosen in permutations(range(j), k):
            np.minimum(best, sum((pairs[:, :, i, c] for i, c in enumerate(chosen)), np.zeros((n, m))), out=best)
        return best
    best = np.empty((n, m))
    for index in np.ndindex(n, m):
        rows, columns = scipy.optimize.linear_sum_assignment(pairs[index])
        best[index] = pairs[index][rows, columns].sum()
    return best
