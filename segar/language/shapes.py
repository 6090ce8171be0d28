"""Outlines of things: circles and convex hulls, their areas and extents."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from segar.errors import FactorError
from segar.language.hull_statistics import hull_log_density, mean_area, mean_perimeter, mean_vertices
from segar.language.hulls import convex_hulls
from segar.support import Estimate, LevelGenerator

CIRCLE = 1  # shape kinds as the kernels see them; 0 means no shape
HULL = 2
HULL_POINTS = 100  # a random hull encloses this many Gaussian points, as in 2022


class BaseShape:
    """A shape with a diameter ``size``. Vertices are relative to the thing's position, counter-clockwise."""

    kind: int
    size: float

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

    @property
    def is_random(self) -> bool:
        return False

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
        self._vertices = vertices

    @property
    def vertices(self) -> np.ndarray:
        return self._vertices


class _Regular(ConvexHull):
    """A hull whose vertices are known, counter-clockwise, for a diameter of 1."""

    corners: tuple[tuple[float, float], ...]

    def __init__(self, size: float = 1.0) -> None:
        BaseShape.__init__(self, size)
        self._vertices = size * np.array(self.corners)


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
    """The hull of 100 Gaussian points with standard deviation ``size / 2`` per axis, drawn anew for every thing."""

    kind = HULL

    def __init__(self, size: float = 0.3) -> None:
        super().__init__(size)

    @property
    def is_random(self) -> bool:
        return True

    def sample(self, rng: np.random.Generator | LevelGenerator, size: int) -> list[np.ndarray]:
        points = rng.normal(0.0, self.size / 2, size=(size, HULL_POINTS, 2))
        return convex_hulls(points)

    def log_prob(self, hulls: Sequence[np.ndarray]) -> np.ndarray:
        """Log density of each hull, vertices float ``(k, 2)`` counter-clockwise, with respect to area in each vertex;
        see :mod:`segar.language.hull_statistics`. Float64 ``(n,)``."""
        count = np.array([len(hull) for hull in hulls])
        padded = np.zeros((len(hulls), count.max(), 2))
        padded[np.arange(count.max()) < count[:, None]] = np.concatenate(list(hulls))
        return hull_log_density(padded, count, self.size / 2, HULL_POINTS)

    def entropy(self, draws: int = 4000, seed: int = 0) -> Estimate:
        """Differential entropy of the vertices [nats], the mean negative log density of so many draws; the error is a
        standard error."""
        density = self.log_prob(self.sample(np.random.default_rng(seed), draws))
        return Estimate(-float(density.mean()), float(density.std(ddof=1)) / draws**0.5)

    @property
    def mean_vertices(self) -> float:
        """Expected number of vertices."""
        return mean_vertices(HULL_POINTS)

    @property
    def mean_perimeter(self) -> float:
        """Expected length of the outline [m]."""
        return mean_perimeter(HULL_POINTS, self.size / 2)

    @property
    def mean_area(self) -> float:
        """Expected area [m^2]."""
        return mean_area(HULL_POINTS, self.size / 2)


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


def area(vertices: np.ndarray) -> float:
    """Area of a convex polygon by the shoelace formula; ``vertices`` float ``(n, 2)``, counter-clockwise."""
    x, y = vertices[:, 0], vertices[:, 1]
    return float(0.5 * (x @ np.roll(y, -1) - y @ np.roll(x, -1)))
