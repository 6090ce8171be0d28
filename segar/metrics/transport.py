"""Optimal transport on cost matrices and between small point sets; POT and scipy do the solving."""

import math
from collections.abc import Iterator
from itertools import permutations

import numpy as np
import scipy

from segar.levels import PointSets
from segar.metrics.points import shorter_way
from segar.support import emd

FEW_MATCHINGS = 24
"""Up to so many ways to match two sets, all are tried at once over all pairs of levels; beyond, scipy solves each pair."""


def same_counts(a: PointSets, b: PointSets) -> Iterator[tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]]:
    """Blocks of level pairs that have the same numbers of points: level indices and points of both sides."""
    for k in np.unique(a.counts):
        levels_a, points_a = a.with_count(k)
        for m in np.unique(b.counts):
            yield (levels_a, points_a, *b.with_count(m))


def matching_costs(a: PointSets, b: PointSets, mismatch: float) -> np.ndarray:
    """Squared distance of every pair of levels by the best partial matching of their points, float64 ``[n, m]``.

    min over partial matchings of  sum_(matched) |x - y|^2 + mismatch^2 * (number of points left over on both sides):
    the generalised optimal sub-pattern assignment metric with p = 2, alpha = 2 and cut-off sqrt(2) mismatch, whose root
    is a metric on finite sets (Rahmathullah, Garcia-Fernandez and Svensson 2017, eq. 1 and proposition 1). Sets of one
    size that lie closer than the cut-off are at their squared Wasserstein-2 distance as counting measures.
    """
    costs = np.empty((len(a.counts), len(b.counts)))
    for levels_a, points_a, levels_b, points_b in same_counts(a, b):
        k, m = points_a.shape[1], points_b.shape[1]
        pairs = np.minimum(_squared_distances(points_a, points_b, a.periods), 2 * mismatch**2)
        costs[np.ix_(levels_a, levels_b)] = _best_matchings(pairs) + mismatch**2 * abs(k - m)
    return costs


def balanced_costs(a: PointSets, b: PointSets, absent: float) -> np.ndarray:
    """Squared Wasserstein-2 distance of every pair of levels, as uniform measures on their points, float64 ``[n, m]``.

    W2^2 = min over couplings of E|x - y|^2; ``absent`` where just one of the two has no point, 0 where both have none.
    """
    costs = np.empty((len(a.counts), len(b.counts)))
    for levels_a, points_a, levels_b, points_b in same_counts(a, b):
        k, m = points_a.shape[1], points_b.shape[1]
        if min(k, m) == 0:
            block = np.full((len(levels_a), len(levels_b)), 0.0 if k == m else absent)
        elif k == m:
            block = _best_matchings(_squared_distances(points_a, points_b, a.periods)) / k
        else:
            block = np.array([[emd(pair) for pair in row] for row in _squared_distances(points_a, points_b, a.periods)])
        costs[np.ix_(levels_a, levels_b)] = block
    return costs


def sliced_costs(a: PointSets, b: PointSets, projections: np.ndarray, absent: float) -> np.ndarray:
    """Squared sliced Wasserstein-2 distance of every pair of levels, float64 ``[n, m]``.

    SW2^2 = mean over directions of the integral of (F^-1(q) - G^-1(q))^2 dq (Bonneel et al. 2015). On a direction the
    quantile functions are the sorted projections, constant between multiples of 1/k and 1/m; taken at these steps and
    weighted by the roots of their widths, they make squared Euclidean distances of all pairs at once.

    Args:
        projections: unit vectors as columns, float64 ``[dimension, directions]``.
        absent: cost where just one of the two has no point; both without a point cost 0.
    """
    costs = np.empty((len(a.counts), len(b.counts)))
    for levels_a, points_a, levels_b, points_b in same_counts(a, b):
        k, m = points_a.shape[1], points_b.shape[1]
        if min(k, m) == 0:
            block = np.full((len(levels_a), len(levels_b)), 0.0 if k == m else absent)
        else:
            steps = np.union1d(np.arange(0, k * m + 1, m), np.arange(0, k * m + 1, k))  # in units of 1 / (k m)
            weights = np.sqrt(np.diff(steps) / (k * m) / projections.shape[1])[:, None]
            sorted_a = np.sort(points_a @ projections, axis=1)[:, steps[:-1] // m] * weights
            sorted_b = np.sort(points_b @ projections, axis=1)[:, steps[:-1] // k] * weights
            block = scipy.spatial.distance.cdist(
                sorted_a.reshape(len(levels_a), -1), sorted_b.reshape(len(levels_b), -1), "sqeuclidean"
            )
        costs[np.ix_(levels_a, levels_b)] = block
    return costs


def _squared_distances(points_a: np.ndarray, points_b: np.ndarray, periods: np.ndarray | None) -> np.ndarray:
    """``|x - y|^2`` for all pairs of levels and of their points, float64 ``[n, m, points of a, points of b]``; the shorter
    way round in components that have a period."""
    (n, k, d), (m, j, _) = points_a.shape, points_b.shape
    if d == 0 or k == 0 or j == 0:
        return np.zeros((n, m, k, j))
    x, y = points_a.reshape(n * k, d), points_b.reshape(m * j, d)
    straight = np.ones(d, bool) if periods is None else np.isinf(periods)
    flat = (
        scipy.spatial.distance.cdist(x[:, straight], y[:, straight], "sqeuclidean")
        if straight.any()
        else np.zeros((n * k, m * j))
    )
    for c in np.flatnonzero(~straight):
        assert periods is not None
        flat += shorter_way((x[:, None, c] - y[None, :, c])[..., None], periods[c : c + 1])[..., 0] ** 2
    return flat.reshape(n, k, m, j).transpose(0, 2, 1, 3)


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
