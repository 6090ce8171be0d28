"""Distances of distributions with their errors, and the distributions that are not numbers: hulls of Gaussian points."""

import itertools
import math

import numpy as np
import pytest
from scipy import special, stats

import segar.noise as sn
from segar.language.shapes import convex_hulls, gaussian_mass, hull_log_density, polygon_areas
from segar.levels.sampling.draws import pad_hulls
from segar.noise.distances import w2_line

SMOOTH = [
    sn.GaussianNoise(0.0, 1.0),
    sn.UniformNoise(-1.0, 2.0),
    sn.LogUniform(0.2, 3.0),
    sn.TruncatedGaussianNoise(0.0, 1.0, (-1.0, 2.0)),
    sn.Mixture([sn.GaussianNoise(-1.0, 0.2), sn.UniformNoise(0.0, 1.0)]),
    sn.GaussianNoise(0.0, 1.0, clip=(-1.0, 1.0)),
    sn.Empirical([-0.5, 0.1, 0.7]),
]


def test_what_has_a_closed_form_has_no_error():
    pairs = [
        (sn.GaussianNoise(0.0, 1.0), sn.GaussianNoise(1.0, 2.0)),
        (sn.UniformNoise(0.0, 1.0), sn.UniformNoise(1.0, 2.5)),
        (sn.Empirical([1.0, 2.0]), sn.DiscreteRangeNoise(1, 3)),
        (sn.RandomTopLocation(), sn.RandomMiddleLocation()),
        (sn.GaussianNoise2D((0, 0), (1, 2)), sn.GaussianNoise2D((0, 1), 1)),
        (sn.LogUniform(0.1, 1.0), sn.Deterministic(0.4)),
    ]
    for a, b in pairs:
        assert a.w2_estimate(b) == (a.w2(b), 0.0), (a, b)


@pytest.mark.parametrize(("a", "b"), list(itertools.combinations(SMOOTH, 2)), ids=repr)
def test_the_stated_errors_hold_the_true_distances(a, b):
    q = (np.arange(50_000) + 0.5) / 50_000
    w2, ks = a.w2_estimate(b), a.ks_estimate(b)
    brute = math.sqrt(np.mean((a.icdf(q) - b.icdf(q)) ** 2))
    assert w2.error < 1e-5 and abs(w2.value - brute) <= w2.error + 4e-4  # the midpoint rule sees no tail
    x = np.linspace(-6.0, 6.0, 200_001)
    gap = np.abs(a.cdf(x) - b.cdf(x)).max()
    assert ks.error <= 2e-6 and gap <= ks.value + ks.error + 1e-12


def test_a_distance_of_distributions_on_the_plane_without_closed_form_says_how_far_off_it_may_be():
    left, right = sn.RandomLeftLocation(), sn.GaussianNoise2D((0.5, 0.0), 0.14)
    here = sn.Mixture([left, right], [0.25, 0.75])
    there = sn.Mixture([sn.Affine(left, shift=(0.3, 0.4)), sn.Affine(right, shift=(0.3, 0.4))], [0.25, 0.75])
    estimate = here.w2_estimate(there)
    assert abs(estimate.value - 0.5) < 0.01 < estimate.error < 0.1  # a shift by 0.5
    measured = sn.Empirical(here.sample(np.random.default_rng(0), 200))
    estimate, whole = measured.w2_estimate(there), measured.w2_estimate(here)
    assert abs(estimate.value - 0.5) <= estimate.error + whole.value  # the triangle inequality
    assert sn.RandomEdgeLocation().w2_estimate(sn.RandomUniformLocation()).error < 0.07


def test_an_image_under_scaling_and_shifting_has_a_closed_form():
    for distribution in (
        sn.RandomEdgeLocation(),
        sn.LogUniform(0.1, 2.0),
        sn.Mixture([sn.UniformNoise(0, 1), sn.Bernoulli(0.3)]),
    ):
        moved = sn.Affine(distribution, scale=0.5, shift=0.2)
        assert distribution.w2_estimate(sn.Affine(moved, shift=0.1)).error == 0.0
        gap = np.asarray(distribution.mean) - np.asarray(moved.mean)
        assert distribution.w2(moved) == pytest.approx(math.sqrt(np.sum(gap**2 + 0.25 * distribution.var)))
        if distribution.width == 1:
            assert w2_line(distribution, moved).value == pytest.approx(distribution.w2(moved), abs=1e-9)
            back = sn.Affine(distribution, scale=-1.0)  # turning round is no optimal map
            assert distribution.w2(back) == pytest.approx(w2_line(distribution, back).value)


def test_a_distribution_of_one_atom_on_the_plane_takes_all_of_the_other():
    edge = sn.RandomEdgeLocation()
    assert sn.CenterLocation().w2_estimate(edge) == (math.sqrt(np.sum(edge.var)), 0.0)


def test_transport_between_points_is_exact():
    a = sn.Empirical([(0.0, 0.0), (1.0, 0.0), (0.0, 1.0)])
    b = sn.Empirical([(1.0, 1.0), (0.0, 0.0), (2.0, 0.0)])
    cost = ((np.array(a.values)[:, None] - np.array(b.values)) ** 2).sum(axis=-1)
    best = min(sum(cost[i, j] for i, j in enumerate(order)) for order in itertools.permutations(range(3)))
    assert a.w2(b) == pytest.approx(math.sqrt(best / 3), abs=1e-12)
    assert a.ks(b) == pytest.approx(1 / 3)  # at (0, 1) two of three points against one


def test_transport_between_atoms_is_exact_however_near_they_are_and_whatever_else_is_far():
    for apart in (1e-2, 1e-9):  # across the cut of the circle: a tenth of the mass goes the short way
        a, b = (sn.Wrapped(sn.Choice([place, 0.0, 1.0], p=[0.1, 0.3, 0.6])) for place in (np.pi - apart, apart - np.pi))
        assert a.w2(b) == pytest.approx(math.sqrt(0.1) * 2 * apart, rel=1e-5)
    for far in (10.0, 1e15):  # three tenths are not 0.3
        places, other = [*np.arange(9.0), far], sn.Choice([1.0, 4.0, far], p=[0.3, 0.6, 0.1])
        line = math.sqrt(0.1 * sum((x - y) ** 2 for x, y in zip(range(9), [1, 1, 1, 4, 4, 4, 4, 4, 4], strict=True)))
        assert sn.Choice(places, p=[0.1] * 10).w2(other) == pytest.approx(line)
        plane = sn.Empirical([(x, 0.0) for x in places])
        there = sn.Empirical([(1.0, 0.0)] * 3 + [(4.0, 0.0)] * 6 + [(far, 0.0)])
        assert plane.w2(there) == pytest.approx(line)


def test_the_error_of_the_ks_of_boxes_is_zero_and_that_of_gaussians_is_small():
    boxes = sn.RandomEdgeLocation().ks_estimate(sn.RandomUniformLocation())
    assert boxes.error == 0.0 and boxes.value == pytest.approx(9 / 16 - 5 / 12, abs=1e-12)
    gaussians = sn.GaussianNoise2D((0.0, 0.0), 1.0).ks_estimate(sn.GaussianNoise2D((0.5, 0.0), 1.0))
    exact = 2 * stats.norm.cdf(0.25) - 1  # where y is infinite
    assert abs(gaussians.value - exact) <= gaussians.error < 0.05


def test_a_narrow_von_mises_is_a_gaussian_and_a_wide_one_uniform():
    assert sn.VonMises(0.2, 1e6).ks(sn.GaussianNoise(0.2, 1e-3)) < 1e-6
    assert sn.VonMises(0.0, 1e-6).ks(sn.UniformNoise(-math.pi, math.pi)) < 1e-6
    distribution, oracle = sn.VonMises(0.3, 4.0), stats.vonmises(4.0, loc=0.3)
    x = np.linspace(0.3 - math.pi, 0.3 + math.pi, 99)
    assert np.allclose(distribution.cdf(x), oracle.cdf(x), atol=1e-13) and np.allclose(
        distribution.pdf(x), oracle.pdf(x), atol=1e-13
    )
    assert distribution.entropy() == pytest.approx(oracle.entropy(), abs=1e-12)
    turned = np.exp(1j * distribution.sample(np.random.default_rng(0), 100_000)).mean()
    assert abs(turned) == pytest.approx(special.ive(1, 4.0) / special.ive(0, 4.0), abs=0.01)
    assert np.angle(turned) == pytest.approx(0.3, abs=0.01)


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
    found, _, _ = hulls(2, 20)
    points = np.random.default_rng(0).normal(size=(200_000, 2))
    for corners in (found[0], found[1] + 1.5):
        edges = np.roll(corners, -1, axis=0) - corners
        away = points[:, None] - corners
        share = (edges[:, 0] * away[..., 1] - edges[:, 1] * away[..., 0] > 0).all(axis=1).mean()
        (mass,) = gaussian_mass(*pad_hulls([corners], 20, None))
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


@pytest.mark.parametrize(
    ("scale", "shift"), [(-2.0, 1.0), (2.0, -1.0), (0.1, 0.7), (-3.0, 0.3), (7.0, 1e3), (1e-9, 1.0)]
)
@pytest.mark.parametrize("values", [[0.0, 1.0], [0.3, 1.7, -0.2], [0.1]])
def test_atoms_of_an_image_are_those_of_the_same_law_said_directly(scale, shift, values):
    masses = np.arange(1.0, len(values) + 1) / sum(range(1, len(values) + 1))
    image = sn.Affine(sn.Choice(values, masses), scale, shift)
    direct = sn.Choice([shift + scale * value for value in values], masses)
    assert image.ks(direct) == pytest.approx(0.0, abs=1e-12) == direct.ks(image)
    below, above = (np.nextafter(direct.atoms[0], end) for end in (-np.inf, np.inf))
    for x in (below, direct.atoms[0], above):
        np.testing.assert_allclose(image.cdf(x), direct.cdf(x), atol=1e-12)
        np.testing.assert_allclose(image.pmf(x), direct.pmf(x), atol=1e-12)


def test_atoms_of_an_image_on_the_plane_are_those_of_the_same_law_said_directly():
    points = [(0.0, 1.0), (1.0, 0.0), (0.3, -0.7)]
    image = sn.Affine(sn.Choice(points, [0.2, 0.3, 0.5]), 2.0, (-1.0, 0.1))
    direct = sn.Choice([(2.0 * x - 1.0, 2.0 * y + 0.1) for x, y in points], [0.2, 0.3, 0.5])
    assert image.ks(direct) == pytest.approx(0.0, abs=1e-12) == direct.ks(image)
