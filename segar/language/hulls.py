"""Convex hulls of many point sets at once."""

import numpy as np


def convex_hulls(points: np.ndarray) -> list[np.ndarray]:
    """Vertices of the convex hull of each of many random point sets, counter-clockwise from the lowest point.

    Args:
        points: float64 ``(sets, points, 2)`` in general position (no two equal heights, no three on a line): points
            drawn from a density are, with probability one. For given points use :func:`segar.language.shapes.convex_hull`.

    Returns:
        One float64 ``(vertices, 2)`` for each set.

    The sets are wrapped side by side (Jarvis 1973): while a chain rises, its next vertex is the point above with the
    largest dx/dy; while it falls, the point below with the largest dx/dy.
    """
    sets, count, _ = points.shape
    order = np.full((sets, count), -1)
    x, y = points[:, :, 0], points[:, :, 1]
    start, top = y.argmin(axis=1), y.argmax(axis=1)
    at, rising, open_ = start.copy(), np.ones(sets, dtype=bool), np.arange(sets)
    order[:, 0] = start
    length = np.ones(sets, dtype=int)
    for step in range(1, count + 1):
        rising[open_] &= at[open_] != top[open_]
        here = at[open_]
        dx = x[open_] - x[open_, here][:, None]
        dy = y[open_] - y[open_, here][:, None]
        ahead = np.where(rising[open_][:, None], dy > 0, dy < 0)
        with np.errstate(divide="ignore", invalid="ignore"):
            slope = np.where(ahead, dx / dy, -np.inf)
        at[open_] = slope.argmax(axis=1)
        open_ = open_[at[open_] != start[open_]]
        if not len(open_):
            break
        order[open_, step] = at[open_]
        length[open_] += 1
    return [points[i, order[i, : length[i]]] for i in range(sets)]
