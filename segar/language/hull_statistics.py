"""Statistics of the convex hull of Gaussian points: the density of its vertices, and its expected number of vertices,
length and area.

Points are independent, with mean zero and standard deviation ``sigma`` per axis. The vertices v_1 ... v_k of the hull of
n points, counter-clockwise from the lowest, have the density

    n! / (n - k)!  *  f(v_1) ... f(v_k)  *  P(a point lies inside the hull)^(n - k)

with respect to area in each vertex, summed over k: any k of the points may be the vertices, and all others lie inside.
"""

import math
from typing import Any

import numpy as np

GRID = 4001  # points of the integrals over one normal variable: the trapezoidal rule, exact to rounding for Gaussians
REACH = 12.0  # standard deviations of these integrals to either side


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

    index = np.arange(vertices.shape[1])
    following = np.where(index[None] + 1 < count[:, None], index + 1, 0)
    edge = np.take_along_axis(vertices, following[..., None], axis=1) - vertices
    length = np.sqrt((edge**2).sum(axis=-1))
    real = (index < count[:, None]) & (length > 0)
    along = edge / np.where(real, length, 1.0)[..., None]
    height = vertices[..., 0] * along[..., 1] - vertices[..., 1] * along[..., 0]  # > 0 where the origin is to the left
    start = (vertices * along).sum(axis=-1)
    real &= height != 0
    h = np.where(real, np.abs(height), 1.0)
    low, high = start / h, (start + length) / h
    angle = (np.arctan(high) - np.arctan(low)) / (2 * math.pi)
    wedge = angle - owens_t(h, high) + owens_t(h, low)
    return np.where(real, np.sign(height) * wedge, 0.0).sum(axis=1)


def mean_vertices(points: int) -> float:
    """Expected number of vertices (Renyi and Sulanke 1963): 4 sqrt(pi) C(n, 2) times the integral of Phi^(n-2) phi^2."""
    return 4 * math.sqrt(math.pi) * math.comb(points, 2) * _integral(points, 2)


def mean_perimeter(points: int, sigma: float) -> float:
    """Expected length of the outline (Efron 1965): 4 pi C(n, 2) times the integral of Phi^(n-2) phi^2."""
    return 4 * math.pi * sigma * math.comb(points, 2) * _integral(points, 2)


def mean_area(points: int, sigma: float) -> float:
    """Expected area (Efron 1965): 3 pi C(n, 3) times the integral of Phi^(n-3) phi^3."""
    return 3 * math.pi * sigma**2 * math.comb(points, 3) * _integral(points, 3)


def _integral(points: int, power: int) -> float:
    from scipy.special import ndtr

    x = np.linspace(-REACH, REACH, GRID)
    phi = np.exp(-0.5 * x * x) / math.sqrt(2 * math.pi)
    return float((ndtr(x) ** (points - power) * phi**power).sum() * (x[1] - x[0]))
