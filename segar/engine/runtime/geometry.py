"""Geometry as the kernels run it. The text below the line is copied into a module that worlds of one layout share.

State of one environment: ``V[entity, column]``; static shapes of its level: ``kind[entity]``, ``count[entity]``
vertices ``vertex[entity, k, 2]``, ``hull_radius[entity]``. Everything is plain Python.
"""

# pyright: reportUndefinedVariable=false
import math

import numpy as np

# Columns and slots; the generated module puts its own in their place.
X = SIZE = ORDER = 0
FLOORS = np.zeros(0, np.int64)
FLOOR_BITS = 0


def njit(function):  # type: ignore[no-untyped-def]
    """Takes the place of numba's decorator where this file is read as plain Python."""
    return function


# --- copied from here on ---
THRESHOLD = 1e-7  # [m] closer than this counts as touching; 2022 uses the same


@njit
def radius(V, kind, hull_radius, i):
    """Radius of a body's disc in contacts: half its Size, or that of the hull's circumscribed disc."""
    return 0.5 * V[i, SIZE] if kind[i] == 1 else hull_radius[i]


@njit
def inside_hull(px, py, n, vertex):
    """The least distance from a point to the hull's edges, positive inside; the hull is counter-clockwise."""
    depth = np.inf
    for k in range(n):
        m = k + 1 if k + 1 < n else 0
        ex = vertex[m, 0] - vertex[k, 0]
        ey = vertex[m, 1] - vertex[k, 1]
        d = (ex * (py - vertex[k, 1]) - ey * (px - vertex[k, 0])) / math.sqrt(ex * ex + ey * ey)
        depth = min(depth, d)
    return depth


@njit
def is_inside(px, py, n, vertex):
    """Whether a point lies in a hull, edges included."""
    for k in range(n):
        m = k + 1 if k + 1 < n else 0
        ex = vertex[m, 0] - vertex[k, 0]
        ey = vertex[m, 1] - vertex[k, 1]
        if ex * (py - vertex[k, 1]) - ey * (px - vertex[k, 0]) < 0.0:
            return False
    return n > 0


@njit
def over(V, kind, count, vertex, hull_radius, i, j):
    """Whether thing ``i`` overlaps thing ``j``: discs touch; a disc overlaps a hull where its centre lies inside."""
    dx = V[i, X] - V[j, X]
    dy = V[i, X + 1] - V[j, X + 1]
    if kind[j] == 2 and kind[i] != 2:
        return dx * dx + dy * dy <= hull_radius[j] * hull_radius[j] and is_inside(dx, dy, count[j], vertex[j])
    if kind[i] == 2 and kind[j] != 2:
        return dx * dx + dy * dy <= hull_radius[i] * hull_radius[i] and is_inside(-dx, -dy, count[i], vertex[i])
    reach = radius(V, kind, hull_radius, i) + radius(V, kind, hull_radius, j) + THRESHOLD
    return dx * dx + dy * dy <= reach * reach


@njit
def within(V, kind, count, vertex, hull_radius, i, j):
    """Whether the disc of ``i`` lies wholly inside the outline of ``j``."""
    dx = V[i, X] - V[j, X]
    dy = V[i, X + 1] - V[j, X + 1]
    r = radius(V, kind, hull_radius, i)
    if kind[j] == 2:
        return inside_hull(dx, dy, count[j], vertex[j]) >= r
    room = 0.5 * V[j, SIZE] - r
    return room >= 0.0 and dx * dx + dy * dy <= room * room


@njit
def topmost(V, bits, kind, count, vertex, hull_radius, i):
    """The floor that thing ``i`` is on: among those under it the one of lowest Order; -1 for none."""
    best = -1
    for f in range(len(FLOORS)):
        j = FLOORS[f]
        above = (bits[j] & FLOOR_BITS) == FLOOR_BITS and (best < 0 or V[j, ORDER] < V[best, ORDER])
        if above and over(V, kind, count, vertex, hull_radius, i, j):
            best = j
    return best
