"""Outlines of things: circles and convex hulls, their areas, and the density of hulls of Gaussian points.

Points are independent, with mean zero and standard deviation ``sigma`` per axis. The vertices v_1 ... v_k
of the hull of n points, counter-clockwise from the lowest, have the density

    n! / (n - k)!  *  f(v_1) ... f(v_k)  *  P(a point lies inside the hull)^(n - k)

with respect to area in each vertex, summed over k: any k of the points may be the vertices, and all others lie inside.
"""

import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from segar.errors import FactorError
from segar.support import LevelGenerator, read_only

CIRCLE = 1  # shape kinds as the kernels see them; 0 means no shape
HULL = 2
HULL_POINTS = 100  # a random hull encloses this many Gaussian points, as in 2022


class BaseShape:
    """A shape with a diameter ``size``. Vertices are relative to the thing's position, counter-clockwise."""

    kind: int
    size: float
    is_random = False

    def __init__(self, size: float) -> None:
        if not isinstance(size, (int, float, np.number)) or not 0 < size < np.inf:
            raise FactorError(f"{type(self).__name__} needs a positive size, not {size!r}")
        self.size = float(size)

    @property
    def vertices(self) -> np.ndarray:
        """Vertices, float64 ``(n, 2)``; ``(0, 2)`` for a circle."""
        return np.zeros((0, 2))

    def sample(self, rng: np.random.Generator | LevelGenerator, size: int) -> list[np.ndarray]:
        """Vertices of ``size`` draws of this shape; only random shapes use ``rng``."""
        return [self.vertices] * size

    def __eq__(self, other: object) -> bool:
        return (
            type(self) is type(other)
            and vars(self).keys() == vars(other).keys()
            and all(np.array_equal(value, vars(other)[name]) for name, value in vars(self).items())
        )

    def __hash__(self) -> int:
        return hash((type(self), self.size))

    def __repr__(self) -> str:
        return f"{type(self).__name__}({self.size:g})"


class Circle(BaseShape):
    """A disc; its radius follows the thing's Size."""

    kind = CIRCLE

    def __init__(self, size: float = 0.2) -> None:
        super().__init__(size)


class ConvexHull(BaseShape):
    """The convex hull of given points, float ``(n, 2)``; its outline is fixed and does not follow Size."""

    kind = HULL

    def __init__(self, points: Any, size: float | None = None) -> None:
        vertices = convex_hull(np.asarray(points, dtype=float))
        super().__init__(float(size) if size is not None else float(np.ptp(vertices, axis=0).max()))
        self._vertices = read_only(vertices)

    @property
    def vertices(self) -> np.ndarray:
        return self._vertices


class _Regular(ConvexHull):
    """A hull whose vertices are known, counter-clockwise, for a diameter of 1."""

    corners: tuple[tuple[float, float], ...]

    def __init__(self, size: float = 1.0) -> None:
        BaseShape.__init__(self, size)
        self._vertices = read_only(size * np.array(self.corners))


class Square(_Regular):
    corners = ((-0.5, -0.5), (0.5, -0.5), (0.5, 0.5), (-0.5, 0.5))


class Triangle(_Regular):
    corners = ((0.0, 3**0.5 / 4), (-0.5, -(3**0.5) / 4), (0.5, -(3**0.5) / 4))


class Hexagon(_Regular):
    corners = (
        (0.5, 0.0),
        (0.25, 3**0.5 / 4),
        (-0.25, 3**0.5 / 4),
        (-0.5, 0.0),
        (-0.25, -(3**0.5) / 4),
        (0.25, -(3**0.5) / 4),
    )


class RandomConvexHull(BaseShape):
    """The hull of 100 Gaussian points with standard deviation ``size / 2`` per axis, drawn anew for every thing.

    >>> corners = segar.RandomConvexHull(0.4).sample(np.random.default_rng(0), 1)[0]
    >>> corners.shape[1]
    2
    """

    kind = HULL
    is_random = True

    def __init__(self, size: float = 0.3) -> None:
        super().__init__(size)

    def sample(self, rng: np.random.Generator | LevelGenerator, size: int) -> list[np.ndarray]:
        points = rng.normal(0.0, self.size / 2, size=(size, HULL_POINTS, 2))
        return convex_hulls(points)

    def log_prob(self, hulls: Sequence[np.ndarray]) -> np.ndarray:
        """Log density of each hull, vertices float ``(k, 2)`` counter-clockwise, with respect to area in each vertex;
        see :mod:`segar.language.shapes`. Float64 ``(n,)``."""
        count = np.array([len(hull) for hull in hulls])
        padded = np.zeros((len(hulls), count.max(), 2))
        padded[np.arange(count.max()) < count[:, None]] = np.concatenate(list(hulls))
        return hull_log_density(padded, count, self.size / 2, HULL_POINTS)


def convex_hull(points: np.ndarray) -> np.ndarray:
    """Vertices of the convex hull of ``points`` (float ``(n, 2)``), counter-clockwise; raises for fewer than 3."""
    if points.ndim != 2 or points.shape[1] != 2 or not np.isfinite(points).all():
        raise FactorError(f"a convex hull needs finite points of shape (n, 2), not {points.shape}")
    from scipy.spatial import ConvexHull as Hull  # scipy is loaded on first use
    from scipy.spatial import QhullError

    try:
        return points[Hull(points).vertices]
    except (QhullError, ValueError):
        raise FactorError(f"these {len(points)} points do not span an area, so they have no convex hull") from None


def polygon_areas(vertices: np.ndarray, counts: np.ndarray) -> np.ndarray:
    """Areas of polygons ``[n, room, 2]``, padded beyond ``counts``, by the shoelace formula; negative where clockwise."""
    after = _next_vertices(vertices, counts)
    cross = vertices[..., 0] * after[..., 1] - vertices[..., 1] * after[..., 0]
    return 0.5 * np.where(np.arange(vertices.shape[1]) < counts[:, None], cross, 0.0).sum(axis=1)


def _next_vertices(vertices: np.ndarray, counts: np.ndarray) -> np.ndarray:
    """The vertex that follows on each; the first one follows on the last."""
    place = np.arange(vertices.shape[1])
    following = np.where(place + 1 < counts[:, None], place + 1, 0)
    return np.take_along_axis(vertices, following[..., None], axis=1)


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


def hull_log_density(vertices: Any, count: Any, sigma: float, points: int) -> np.ndarray:
    """Log density of hulls of ``points`` Gaussian points, float64 ``(n,)``.

    Args:
        vertices: float ``(n, room, 2)``, counter-clockwise; what lies beyond ``count`` is left aside.
        count: int ``(n,)``, how many vertices each hull has: from 3 to ``points``, else the density is zero.
    """
    from scipy.special import gammaln

    vertices, count = np.asarray(vertices, dtype=float) / sigma, np.asarray(count)
    used = np.arange(vertices.shape[1]) < count[:, None]
    square = np.where(used, (vertices**2).sum(axis=-1), 0.0).sum(axis=1)
    inside = gaussian_mass(vertices, count)
    possible = (count >= 3) & (count <= points)
    rest = np.where(possible, points - count, 0)
    ways = math.lgamma(points + 1) - gammaln(rest + 1)
    density = -0.5 * square - count * math.log(2 * math.pi * sigma**2)
    with np.errstate(divide="ignore", invalid="ignore"):
        beyond = np.where(rest > 0, rest * np.log(np.clip(inside, 0.0, 1.0)), 0.0)
    return np.where(possible, ways + density + beyond, -np.inf)


def gaussian_mass(vertices: np.ndarray, count: np.ndarray) -> np.ndarray:
    """Mass of the standard Gaussian inside polygons, float64 ``(n,)``: the signed triangles from the origin to each edge,
    by Owen's T function (Owen 1956)."""
    from scipy.special import owens_t

    edge = _next_vertices(vertices, count) - vertices
    length = np.sqrt((edge**2).sum(axis=-1))
    real = (np.arange(vertices.shape[1]) < count[:, None]) & (length > 0)
    along = edge / np.where(real, length, 1.0)[..., None]
    height = vertices[..., 0] * along[..., 1] - vertices[..., 1] * along[..., 0]  # > 0 where the origin is to the left
    start = (vertices * along).sum(axis=-1)
    real &= height != 0
    h = np.where(real, np.abs(height), 1.0)
    low, high = start / h, (start + length) / h
    angle = (np.arctan(high) - np.arctan(low)) / (2 * math.pi)
    wedge = angle - owens_t(h, high) + owens_t(h, low)
    return np.where(real, np.sign(height) * wedge, 0.0).sum(axis=1)
