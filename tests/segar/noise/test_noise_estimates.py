"""The distribution of hulls of Gaussian points."""

import math

import numpy as np
import pytest
from scipy import stats

from segar.language.shapes import convex_hulls, gaussian_mass, hull_log_density, polygon_areas
from segar.levels.sampling.draws import pad_hulls


def hulls(count: int, points: int, sigma: float = 1.0) -> tuple[list[np.ndarray], np.ndarray, np.ndarray]:
    found = convex_hulls(np.random.default_rng(points).normal(0.0, sigma, (count, points, 2)))
    return found, *pad_hulls(found, points, None)


def mean_vertices(points: int) -> float:
    """Expected number of vertices (Renyi and Sulanke 1963): 4 sqrt(pi) C(n, 2) times the integral of Phi^(n-2) phi^2."""
    return 4 * math.sqrt(math.pi) * math.comb(points, 2) * integral(points, 2)


def integral(points: int, power: int) -> float:
    x = np.linspace(-12, 12, 4001)
    return float((stats.norm.cdf(x) ** (points - power) * stats.norm.pdf(x) ** power).sum() * (x[1] - x[0]))


def test_random_hulls_have_the_mean_vertices_outline_and_area_that_theory_says():
    found, padded, count = hulls(4000, 100, sigma=0.15)
    outlines = np.array([np.linalg.norm(hull - np.roll(hull, 1, axis=0), axis=1).sum() for hull in found])
    for seen, expected in [
        (count, mean_vertices(100)),
        (polygon_areas(padded, count), 3 * math.pi * 0.15**2 * math.comb(100, 3) * integral(100, 3)),  # Efron 1965
        (outlines, mean_vertices(100) * math.sqrt(math.pi) * 0.15),
    ]:
        assert abs(seen.mean() - expected) < 4 * seen.std() / math.sqrt(len(seen))


def test_the_mass_in_a_polygon_is_the_share_of_points_inside():
    found, padded, count = hulls(5, 20)
    off_centre = padded + np.where(np.arange(20)[None, :, None] < count[:, None, None], 1.5, 0.0)
    points = np.random.default_rng(0).normal(size=(200_000, 2))
    for hull, shift, mass in [(found[0], 0.0, gaussian_mass(padded, count)[0]), (found[1], 1.5, None)]:
        corners = hull + shift
        edges = np.roll(corners, -1, axis=0) - corners
        away = points[:, None] - corners
        share = (edges[:, 0] * away[..., 1] - edges[:, 1] * away[..., 0] > 0).all(axis=1).mean()
        mass = gaussian_mass(off_centre, count)[1] if mass is None else mass
        assert share == pytest.approx(mass, abs=4 * 0.5 / math.sqrt(200_000))


def test_the_density_of_a_hull_of_four_points_integrates_to_one():
    triples, padded, count = hulls(40_000, 3)
    proposal = stats.norm.logpdf(np.array([np.ravel(t) for t in triples])).sum(axis=1) + math.log(math.factorial(3))
    ratio = np.exp(hull_log_density(padded, count, 1.0, 4) - proposal)
    _, _, vertices = hulls(40_000, 4)
    triangles = (vertices == 3).mean()
    assert ratio.mean() == pytest.approx(triangles, abs=4 * (ratio.std() + 0.5) / math.sqrt(40_000))
    found, padded, count = hulls(2000, 4)
    corners = [hull for hull in found if len(hull) == 4]
    flat = stats.norm.logpdf(np.array([np.ravel(hull) for hull in corners])).sum(axis=1) + math.log(24)
    assert np.allclose(hull_log_density(padded[count == 4], count[count == 4], 1.0, 4), flat)
