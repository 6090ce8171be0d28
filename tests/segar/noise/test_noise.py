"""Distributions: one table of distributions, many properties; scipy and large samples as oracles."""

import inspect
import itertools
import json
import math
import pickle
import re

import numpy as np
import pytest
from scipy import stats

import segar.noise as sn
from segar.errors import PriorError
from segar.noise.base import Noise, moments, quadrature
from segar.support.counter_rng import LevelGenerator, stream_key
from tests.places import ROOT

DRAWS = 40_000
MANY_DRAWS = 200_000
LINE = [
    sn.GaussianNoise(1.0, 2.0),
    sn.GaussianNoise(0.2, 0.01, clip=(0.1, 0.3)),
    sn.GaussianNoise(-1.0, 0.1, clip=(-1.0, -0.5)),
    sn.GaussianNoise(1.0, 0.4, clip=(0.0, 1.0)),
    sn.GaussianNoise(0.0, 1.0, clip=(0.5, math.inf)),
    sn.GaussianNoise(0.0, 1.0, clip=(0.1, 0.1 + 1e-9)),
    sn.UniformNoise(-2.0, 3.0),
    sn.LogUniform(0.1, 4.0),
    sn.GaussianMixtureNoise(means=[-1.0, 1.0], stds=[0.1, 0.1]),
    sn.GaussianMixtureNoise(means=[-1.0, 0.0, 2.0], stds=[0.1, 1.0, 0.3], pvals=[0.2, 0.5, 0.3]),
    sn.DiscreteRangeNoise(1, 4),
    sn.Bernoulli(0.3),
    sn.Choice([0.5, 2.0, 2.0], [0.2, 0.5, 0.3]),
    sn.Deterministic(2.0),
    sn.Mixture([sn.GaussianNoise(0.0, 1.0, (-1.0, 1.0)), sn.Deterministic(3.0), sn.UniformNoise(1.0, 2.0)]),
    sn.TruncatedGaussianNoise(0.2, 0.1, truncate=(0.1, 0.5)),
    sn.TruncatedGaussianNoise(0.0, 1.0, truncate=(6.0, math.inf)),
    sn.VonMises(0.3, 4.0),
    sn.VonMises(-1.0, 0.2),
    sn.Empirical([0.5, -1.0, 2.0, 2.0, 3.5]),
    sn.Affine(sn.LogUniform(0.1, 4.0), scale=-2.0, shift=0.3),
    sn.Affine(sn.GaussianNoise(0.2, 0.1, clip=(0.1, 0.3)), scale=-3.0, shift=0.7),
    sn.Affine(sn.Bernoulli(0.3), scale=0.1, shift=0.7),
    sn.Wrapped(sn.GaussianNoise(2.0, 1.5)),
    sn.Wrapped(sn.GaussianNoise(0.4, 0.2, clip=(0.1, 0.6)), period=0.5),
    sn.TruncatedGaussianNoise(0.0, 1.0, truncate=(0.0, math.inf)),
    sn.TruncatedGaussianNoise(0.0, 1e17, truncate=(-1.0, 1.0)),
    sn.LogUniform(1.0, 1.0 + 1e-9),
    sn.Affine(sn.GaussianNoise(1.0, 2.0), scale=-2.0, shift=0.3),
]
BOX = re.compile(r"(\[\S+, \S+\]) x (\[\S+, \S+\])")
ROW = re.compile(r"^\| `(\w+Location)` \| (\[\S+, \S+\]|0)[^|]* \| (\[\S+, \S+\]|0) \|$", re.M)
PAGE = (ROOT / "docs/reference/factors-and-entities.md").read_text()
LOCATIONS = {getattr(sn, name): (json.loads(x), json.loads(y)) for name, x, y in ROW.findall(PAGE)}
PLANE = [
    *(location() for location in LOCATIONS),
    sn.GaussianNoise2D((0.1, 0.2), 0.1, clip=(-0.5, 0.2)),
    sn.GaussianNoise2D((0.1, -0.2), (0.3, 0.5)),
    sn.Independent(sn.GaussianNoise(0.0, 0.3), 0.5),
    sn.Affine(sn.RandomEdgeLocation(), scale=0.5, shift=(0.2, -0.1)),
    sn.Affine(sn.Independent(sn.GaussianNoise(0.0, 0.3), 0.7), scale=0.3, shift=(0.1, 0.2)),
    sn.Mixture([sn.RandomTopLocation(), sn.GaussianNoise2D((0, 0), (0.3, 0.5))], [0.25, 0.75]),
    sn.Mixture([sn.CenterLocation(), sn.RandomMiddleLocation()]),
    sn.Empirical([(0.1, 0.2), (-0.3, 0.4), (-0.3, 0.4)]),
    sn.Choice([(0.0, 0.0), (1.0, 2.0)], [0.25, 0.75]),
]
every_distribution = pytest.mark.parametrize("distribution", LINE, ids=repr)


def draws(distribution: sn.Noise, count: int = DRAWS) -> np.ndarray:
    """Draws from the generator that levels use."""
    return np.asarray(
        distribution.sample(LevelGenerator(stream_key(repr(distribution)), np.arange(count)), count), dtype=float
    )


@every_distribution
def test_the_share_of_many_draws_up_to_x_is_the_cdf(distribution):
    for x in (draws(distribution, MANY_DRAWS), distribution.sample(np.random.default_rng(0), MANY_DRAWS)):
        x = np.sort(np.asarray(x, float))
        grid = np.unique(np.concatenate([x[:: MANY_DRAWS // 1000], np.linspace(x[0] - 1, x[-1] + 1, 51)]))
        share = np.searchsorted(x, grid, side="right") / MANY_DRAWS
        assert np.abs(share - distribution.cdf(grid)).max() < 1.95 / math.sqrt(MANY_DRAWS)  # the DKW bound at 1e-3


@pytest.mark.parametrize("distribution", LINE + PLANE, ids=repr)
def test_moments_entropy_and_support_are_those_of_the_draws(distribution):
    x = draws(distribution)
    assert np.abs(x.mean(axis=0) - distribution.mean).max() <= 4 * math.sqrt(np.max(distribution.var) / DRAWS)
    np.testing.assert_allclose(x.var(axis=0), distribution.var, rtol=0.05, atol=1e-12)
    assert -distribution.log_prob(x).mean() == pytest.approx(distribution.entropy(), abs=0.03)
    low, high = np.moveaxis(np.array(distribution.support), -1, 0)
    assert (low <= x).all() and (x <= high).all()


@every_distribution
def test_closed_moments_and_entropy_agree_with_quadrature(distribution):
    assert moments(distribution) == pytest.approx((distribution.mean, distribution.var), rel=1e-6, abs=1e-9)
    assert Noise.entropy(distribution) == pytest.approx(distribution.entropy(), rel=1e-6, abs=1e-9)


@every_distribution
def test_the_quantile_is_where_the_cdf_reaches_q(distribution):
    q = np.linspace(0.005, 0.995, 67)
    x = distribution.icdf(q)
    assert (distribution.cdf(x) >= q - 1e-9).all()
    assert (distribution.cdf(x - 1e-6) <= q + 1e-4).all()
    assert np.isnan(distribution.icdf(-0.1)) and np.isnan(distribution.icdf(1.1))


@every_distribution
def test_density_and_atoms_hold_the_whole_mass(distribution):
    x, weight = quadrature(distribution.pieces)
    assert distribution.atoms[1].sum() + weight @ distribution.pdf(x) == pytest.approx(1.0, abs=1e-9)
    assert np.allclose(distribution.pmf(distribution.atoms[0]), distribution.atoms[1])


@every_distribution
def test_what_a_distribution_hands_out_does_not_lead_back_into_it(distribution):
    before = [one.copy() for one in (distribution.pieces, *distribution.atoms)]
    for one in (distribution.pieces, *distribution.atoms):
        if one.flags.writeable:
            one += 1.0
    assert all(map(np.array_equal, before, (distribution.pieces, *distribution.atoms)))


@every_distribution
def test_a_distribution_survives_pickling_and_says_how_it_was_made(distribution):
    assert pickle.loads(pickle.dumps(distribution)) == distribution
    names = {name: getattr(sn, name) for name in dir(sn)}
    assert eval(repr(distribution), names | {"inf": math.inf}) == distribution


@pytest.mark.parametrize(
    ("distribution", "oracle"),
    [
        (sn.GaussianNoise(1.0, 2.0), stats.norm(1.0, 2.0)),
        (sn.UniformNoise(0.2, 1.0), stats.uniform(0.2, 0.8)),
        (sn.LogUniform(0.1, 4.0), stats.loguniform(0.1, 4.0)),
        (sn.TruncatedGaussianNoise(1.0, 2.0, (-1.0, 3.0)), stats.truncnorm(-1.0, 1.0, 1.0, 2.0)),
        (sn.Affine(sn.LogUniform(0.1, 4.0), 2.0, -1.0), stats.loguniform(0.1, 4.0, -1.0, 2.0)),
    ],
    ids=["gaussian", "uniform", "log-uniform", "truncated", "affine"],  # an oracle's repr holds its address
)
def test_continuous_distributions_agree_with_scipy(distribution, oracle):
    x = np.linspace(-3.0, 5.0, 101)
    assert np.allclose(distribution.cdf(x), oracle.cdf(x), atol=1e-14)
    assert np.allclose(distribution.pdf(x), oracle.pdf(x), atol=1e-14)
    assert np.allclose(distribution.icdf([0.1, 0.5, 0.9]), oracle.ppf([0.1, 0.5, 0.9]))
    assert (distribution.mean, distribution.var, distribution.entropy()) == pytest.approx(
        (oracle.mean(), oracle.var(), oracle.entropy())
    )


@pytest.mark.parametrize(
    ("a", "b"),
    list(itertools.combinations([*LINE[:3], *LINE[5:10], LINE[13], LINE[14], LINE[19], LINE[-1]], 2)),
    ids=repr,
)
def test_w2_and_ks_agree_with_brute_force(a, b):
    q = (np.arange(20_000) + 0.5) / 20_000
    assert a.w2(b) == pytest.approx(math.sqrt(np.mean((a.icdf(q) - b.icdf(q)) ** 2)), abs=5e-3)
    assert a.w2(b) == pytest.approx(b.w2(a), abs=1e-12)
    x = np.linspace(-6.0, 8.0, 50_001)
    brute = np.abs(a.cdf(x) - b.cdf(x)).max()
    assert brute - 1e-9 <= a.ks(b) <= brute + 2e-3
    assert a.ks(b) == pytest.approx(b.ks(a), abs=1e-12)


@pytest.mark.parametrize("distribution", LINE + PLANE, ids=repr)
def test_a_distribution_is_at_no_distance_from_itself(distribution):
    assert distribution.w2(distribution) == 0.0
    if distribution.width == 1:
        assert distribution.ks(distribution) == 0.0


def test_a_constant_can_stand_for_a_distribution_in_distances():
    distribution = sn.UniformNoise(0.0, 1.0)
    assert distribution.w2(0.5) == pytest.approx(math.sqrt(1 / 12))
    assert distribution.ks(0.25) == pytest.approx(0.75)


@pytest.mark.parametrize("distribution", PLANE, ids=repr)
def test_on_the_plane_the_share_of_draws_below_is_the_cdf(distribution):
    x = draws(distribution, MANY_DRAWS)
    corners = np.random.default_rng(1).uniform(-1, 1, (40, 2))
    share = [((x[:, 0] <= a) & (x[:, 1] <= b)).mean() for a, b in corners]
    assert np.abs(share - distribution.cdf(corners)).max() < 4.5 * 0.5 / math.sqrt(MANY_DRAWS)


@pytest.mark.parametrize("location", LOCATIONS)
def test_help_and_the_reference_name_the_box_in_which_a_location_lies(location):
    assert {one.__name__ for one in LOCATIONS} == {name for name in dir(sn) if name.endswith("Location")}
    on_page = np.array(LOCATIONS[location], float).reshape(2, -1)
    x = draws(location())
    np.testing.assert_allclose(x.min(axis=0), on_page[:, 0], atol=1e-3)
    np.testing.assert_allclose(x.max(axis=0), on_page[:, -1], atol=1e-3)
    np.testing.assert_allclose(location().support, on_page[:, [0, -1]])
    text = inspect.getdoc(location)
    if location is sn.CenterLocation:
        assert "(0, 0)" in text
    else:
        np.testing.assert_array_equal([json.loads(part) for part in BOX.search(text).groups()], on_page)


def test_the_edge_is_the_rim_without_the_middle():
    x = draws(sn.RandomEdgeLocation())
    _, inside = BOX.findall(inspect.getdoc(sn.RandomEdgeLocation))
    assert tuple(tuple(json.loads(part)) for part in inside) == sn.RandomMiddleLocation().support
    assert (np.abs(x).max(axis=1) >= 0.475).all()
    cells = np.histogram2d(x[:, 0], x[:, 1], bins=[[-0.95, -0.475, 0, 0.475, 0.95]] * 2)[0]
    rim = cells[~np.pad(np.ones((2, 2), dtype=bool), 1)]
    assert cells[1:3, 1:3].sum() == 0 and stats.chisquare(rim).pvalue > 1e-3


def test_distances_of_boxes_on_the_plane_are_exact():
    top, bottom = sn.RandomTopLocation(), sn.RandomBottomLocation()
    assert top.w2(bottom) == pytest.approx(0.475 + 0.95)
    assert top.ks(bottom) == 1.0
    assert sn.CenterLocation().w2(sn.RandomMiddleLocation()) == pytest.approx(math.sqrt(2 * 0.95**2 / 12))


def test_the_w2_of_plane_gaussians_is_that_of_means_and_deviations():
    a, b = sn.GaussianNoise2D((0.0, 0.0), (1.0, 2.0)), sn.GaussianNoise2D((3.0, 4.0), (2.0, 4.0))
    assert a.w2(b) == pytest.approx(math.sqrt(25.0 + 1.0 + 4.0))


def test_one_draw_without_size_is_a_number():
    rng = np.random.default_rng(0)
    assert all(np.ndim(distribution.sample(rng)) == 0 for distribution in LINE)
    assert all(np.shape(distribution.sample(rng)) == (2,) for distribution in PLANE)


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: sn.GaussianNoise(-1.0, 0.1, clip=(-0.5, -1.0)), r"did you mean \(-1, -0.5\)\?"),
        (lambda: sn.GaussianNoise(0.0, 0.0), "std must be positive, not 0.0; for a constant give the value itself"),
        (lambda: sn.GaussianNoise("a", 1.0), "mean must be a finite number, not 'a'"),
        (lambda: sn.UniformNoise(1.0, 0.2), r"did you mean \(0.2, 1\)\?"),
        (lambda: sn.UniformNoise(1.0, 1.0), "for a constant give the value itself"),
        (lambda: sn.DiscreteRangeNoise(1.5, 3), "low and high must be whole numbers"),
        (lambda: sn.GaussianMixtureNoise([0, 1], [1]), "2 means and 1 stds"),
        (lambda: sn.GaussianMixtureNoise([0, 1], [1, 1], [0.5, 0.6]), "sum to 1"),
        (lambda: sn.Choice([1, 2], [1.0]), "1 probabilities were given for 2 members"),
        (lambda: sn.Choice([]), "at least one key"),
        (lambda: sn.Bernoulli(1.5), r"p must lie in \[0, 1\]"),
        (lambda: sn.LogUniform(0.0, 1.0), "low must be positive"),
        (lambda: sn.Mixture([sn.UniformNoise(0, 1), sn.CenterLocation()]), "all on the line or all on the plane"),
        (lambda: sn.TruncatedGaussianNoise(0.0, 1.0, (50.0, 60.0)), r"no mass lies in \(50, 60\)"),
        (lambda: sn.VonMises(0.0, 0.0), "kappa must be positive"),
        (lambda: sn.Wrapped(sn.CenterLocation()), "Wrapped needs a distribution on the line"),
        (lambda: sn.Wrapped(sn.Bernoulli(0.5), period=-1.0), "the period must be positive, not -1.0"),
        (lambda: sn.VonMises().w2(sn.Wrapped(sn.Bernoulli(0.5), 1.0)), "periods 6.28319 and 1: .* different circles"),
        (lambda: sn.Mixture([sn.VonMises(), sn.Wrapped(sn.Bernoulli(0.5), 1.0)]), "that live on one circle"),
        (lambda: sn.Empirical([[1.0, 2.0, 3.0]]), r"numbers \(n,\) or points"),
        (lambda: sn.Empirical([1.0, math.nan]), "leave out those that are missing"),
        (lambda: sn.Affine(sn.Bernoulli(0.5), scale=0.0), "scale must be other than zero"),
        (lambda: sn.Affine(sn.CenterLocation(), scale=-1.0), "scale must be positive on the plane"),
        (lambda: sn.Affine(sn.Bernoulli(0.5), shift=(1.0, 2.0)), "shift must be a finite number"),
        (
            lambda: sn.Mixture([sn.Independent(0.0, sn.UniformNoise(0, 1)), sn.RandomTopLocation()]).entropy(),
            "of its mass lies on lines",
        ),
        (lambda: sn.UniformNoise(0, 1).w2(sn.CenterLocation()), "here one on the line is needed"),
        (lambda: sn.GaussianNoise2D((0, 0), (1, 0)), "std positive"),
        (lambda: sn.Choice(["a", "b"]).cdf(0.0), "things that are not numbers"),
        (lambda: sn.Choice(["a", "b"]).w2(sn.Bernoulli(0.5)), r"Choice.*among things that are not numbers"),
        (lambda: sn.Choice(3), "Choice: keys must be a list, not 3"),
        (lambda: sn.Choice([0.0, math.nan]), "a key is not a finite number"),
        (lambda: sn.GaussianNoise(0.0, 1.0, clip=(math.inf, math.inf)), "clip must go from low to high"),
        (lambda: sn.LogUniform(1e-200, 1e200), "high / low finite"),
        (lambda: sn.DiscreteRangeNoise(0, 10**12), "too many or too large numbers"),
        (lambda: sn.DiscreteRangeNoise(2**53 + 1, 2**53 + 3), "too many or too large numbers"),
        (lambda: sn.Wrapped(sn.GaussianNoise(0.0, 1e6)).cdf(0.0), "goes round its circle 3183098 times"),
        (lambda: sn.Choice([1, 2], ["a", 1]), "probabilities must be a list of numbers"),
        (lambda: sn.Choice([0.0, 1.0], {0.0: 0.25, 1.0: 0.75}), "probabilities must be a list of numbers"),
        (lambda: sn.Mixture(sn.Bernoulli(0.5)), "Mixture: laws must be a list"),
        (lambda: sn.Mixture([sn.UniformNoise(0, 1), 3.0]), "all on the line or all on the plane"),
        (lambda: sn.GaussianMixtureNoise(0.0, 1.0), "means must be a list, not 0.0"),
        (lambda: sn.DiscreteRangeNoise(0, math.inf), "low and high must be whole numbers"),
        (lambda: sn.UniformNoise("0", 1.0), r"must be two numbers \(low, high\)"),
        (lambda: sn.GaussianNoise(0.0, 1.0, clip=(math.nan, 1.0)), r"clip must be two numbers \(low, high\)"),
        (lambda: sn.RandomTopLocation().cdf(0.5), r"x must have shape \(..., 2\), not \(\)"),
        (lambda: sn.Empirical([(0.0, 1.0)]).cdf([1.0, 2.0, 3.0]), r"x must have shape \(..., 2\), not \(3,\)"),
    ],
)
def test_a_distribution_that_makes_no_sense_is_refused(make, message):
    with pytest.raises(PriorError, match=message):
        make()


def test_a_distribution_of_ones_own_needs_only_to_be_sampled():
    class Triangular(sn.Noise):
        def sample(self, rng, size=None):
            return rng.random(size) + rng.random(size)

    assert Triangular().sample(np.random.default_rng(0), 3).shape == (3,)
    with pytest.raises(PriorError, match=r"Triangular does not say its distribution function: define cdf"):
        Triangular().cdf(0.5)


def test_the_distances_of_a_distribution_of_ones_own_are_computed_from_its_cdf():
    class Uniform(sn.Noise):
        pieces = np.array([0.0, 1.0])

        def sample(self, rng, size=None):
            return rng.random(size)

        def cdf(self, x):
            return np.clip(x, 0.0, 1.0)

        def pdf(self, x):
            return np.where((np.asarray(x) >= 0) & (np.asarray(x) <= 1), 1.0, 0.0)

    own, shifted = Uniform(), sn.UniformNoise(1.0, 2.0)
    assert own.w2(shifted) == pytest.approx(1.0) and shifted.w2(own) == pytest.approx(1.0)
    assert own.ks(shifted) == pytest.approx(1.0) and own.entropy() == pytest.approx(0.0, abs=1e-12)
    assert (own.mean, own.var) == pytest.approx((0.5, 1 / 12))
