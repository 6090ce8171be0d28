"""Kolmogorov-Smirnov statistics: against scipy per factor, and against the search over all points for the joint."""

from itertools import product

import numpy as np
import pytest
from scipy import stats

import segar
from segar import GaussianNoise, GolfBall, LevelDistribution, Levels, Magnet, Prior, RandomUniformLocation, UniformNoise
from segar.errors import LevelError
from segar.language import Charger, Gravity, Position
from segar.metrics import ks, ks_by_factor, ks_report
from segar.metrics.distribution_functions import factor_marginals
from segar.metrics.kolmogorov import dkw_band, joint_difference
from segar.metrics.marginal_distributions import component, count_distribution
from segar.noise import Independent


def balls(points: np.ndarray) -> Levels:
    return Levels.from_entities([[GolfBall({Position: p})] for p in points])


def test_each_factor_has_the_statistic_of_scipy():
    a = segar.family("objectsx2-hard").sample(60, seed=0, split="train")
    b = segar.family("objectsx2-hard").sample(90, seed=0, split="test")
    by_factor = ks_by_factor(a, b)
    for kind, factor in ((Charger, segar.Charge), (Magnet, segar.Magnetism), (GolfBall, segar.Size)):
        column = a.layout.columns[factor]
        x, y = (s.values[s.types == s.layout.types.index(kind)][:, column] for s in (a, b))
        assert by_factor[f"{kind.__name__}.{factor.__name__}"] == pytest.approx(stats.ks_2samp(x, y).statistic)
    x, y = (s.values[:, s.layout.slot_index("golfball"), s.layout.columns[Position] + 1] for s in (a, b))
    assert by_factor["GolfBall.Position.y"] == pytest.approx(stats.ks_2samp(x, y).statistic)
    counts = [(s.types == s.layout.types.index(Charger)).sum(axis=1) for s in (a, b)]
    assert by_factor["Charger.count"] == pytest.approx(stats.ks_2samp(*counts).statistic)


@pytest.mark.parametrize("seed", range(5))
def test_the_joint_statistic_is_the_largest_difference_over_all_points(seed):
    rng = np.random.default_rng(seed)
    x, y = rng.normal(size=(12, 2)), rng.normal(0.3, 1.5, size=(9, 2))
    x[:4, 0], y[:2, 0] = 0.0, 0.0  # ties

    def product_of_cdfs(points: np.ndarray, at: tuple[float, ...]) -> float:
        return float(np.prod([(points[:, k] <= at[k]).mean() for k in range(2)]))

    grid = product(*(np.append(np.concatenate([x[:, k], y[:, k]]), np.inf) for k in range(2)))
    plain = max(abs(product_of_cdfs(x, at) - product_of_cdfs(y, at)) for at in grid)
    assert ks(balls(x), balls(y)) == pytest.approx(plain, abs=1e-12)


def test_the_joint_search_is_exact_for_many_factors():
    rng = np.random.default_rng(1)
    curves = [tuple(np.sort(rng.uniform(size=(2, 5)), axis=1)) for _ in range(5)]
    curves = [(np.append(f, 1.0), np.append(g, 1.0)) for f, g in curves]
    plain = max(
        abs(
            np.prod([f[k] for (f, _), k in zip(curves, at, strict=True)])
            - np.prod([g[k] for (_, g), k in zip(curves, at, strict=True)])
        )
        for at in product(range(6), repeat=5)
    )
    assert joint_difference(curves) == pytest.approx(plain, abs=1e-12)


def test_the_joint_statistic_is_at_least_each_factors_and_symmetric():
    a = segar.family("tilesx1-hard").sample(40, seed=0, split="train")
    b = segar.family("tilesx1-medium").sample(50, seed=0, split="test")
    assert ks(a, b) == ks(b, a)
    assert max(ks_by_factor(a, b).values()) <= ks(a, b) <= 1.0
    assert ks(a, a) == 0.0


def test_a_type_that_one_set_lacks_shows_in_its_count_alone():
    a, b = (Levels.from_entities([[GolfBall()], [kind()]]) for kind in (GolfBall, Charger))
    by_factor = ks_by_factor(a, b)
    assert by_factor["Charger.count"] == 0.5
    assert not any(name.startswith("Charger.") for name in by_factor if name != "Charger.count")


def test_world_parameters_and_chosen_factors():
    a, b = (Levels.from_entities([[GolfBall()]], parameters={Gravity: g}) for g in (9.0, 10.0))
    assert ks_by_factor(a, b)["world.Gravity"] == 1.0
    assert set(ks_by_factor(a, b, factors=[Position])) == {
        "GolfBall.count",
        "GolfBall.Position.x",
        "GolfBall.Position.y",
    }


LOW_AND_HIGH = (UniformNoise(-0.5, 0.5), UniformNoise(-0.2, 0.8))


def charged(distribution: object, position: object = RandomUniformLocation()) -> LevelDistribution:
    return LevelDistribution(
        numbers=[(Charger, 1)], priors=[Prior(segar.Charge, distribution), Prior(Position, position)], min_distance=0.0
    )


def test_known_distributions_are_compared_exactly():
    a, b = (charged(distribution) for distribution in LOW_AND_HIGH)
    assert ks_by_factor(a, b)["Charger.Charge"] == pytest.approx(0.3, abs=1e-12)
    assert ks(a, b) == pytest.approx(0.3, abs=1e-12)
    assert ks(a, a) == 0.0
    assert ks_by_factor(a, charged(GaussianNoise(0.0, 0.2)))["Charger.Charge"] == pytest.approx(
        UniformNoise(-0.5, 0.5).ks(GaussianNoise(0.0, 0.2)), abs=1e-12
    )


def test_the_joint_of_distributions_is_the_largest_difference_of_products_of_distribution_functions():
    # F = x y and G = x^2 y^2 by max of two uniforms: the difference t - t^2 with t = x y is largest at 1/4; here by shifts.
    a = charged(UniformNoise(0.0, 1.0), Independent(UniformNoise(0.0, 0.5), UniformNoise(0.0, 0.5)))
    b = charged(UniformNoise(0.2, 1.0), Independent(UniformNoise(0.1, 0.5), UniformNoise(0.0, 0.5)))
    c, x = np.meshgrid(np.linspace(0, 1, 1001), np.linspace(0, 0.5, 1001))
    plain = np.abs(c * 2 * x - np.clip((c - 0.2) / 0.8, 0, 1) * np.clip((x - 0.1) / 0.4, 0, 1)).max()
    assert ks(a, b) == pytest.approx(plain, abs=1e-3)
    assert ks(a, b) == pytest.approx(ks(b, a), abs=1e-12)


@pytest.mark.slow
def test_many_levels_are_near_their_distribution_in_every_family():
    for name in (*segar.families(), "puttputt", "billiards", "invisiball"):
        distribution = segar.family(name)
        for marginal in factor_marginals("test", distribution.sample(1000, seed=1, split="train"), distribution, None):
            # A wrong distribution would be off by far more than 1.5 times the band, which chance exceeds once in 3,000.
            assert marginal.largest_difference() < 1.5 * dkw_band(len(marginal.sample)), (name, marginal.name)


def test_a_sample_against_a_distribution_has_the_statistic_and_the_p_value_of_scipy():
    levels, distribution = charged(UniformNoise(-0.4, 0.5)).sample(40, seed=3, split="train"), charged(LOW_AND_HIGH[0])
    report = next(
        f
        for f in ks_report(levels, distribution, rng=np.random.default_rng(0), resamples=19).factors
        if f.name == "Charger.Charge"
    )
    scipy = stats.ks_1samp(levels.values[:, 0, levels.layout.columns[segar.Charge]], stats.uniform(-0.5, 1.0).cdf)
    assert report.value == pytest.approx(scipy.statistic, abs=1e-12)
    assert report.p_value == pytest.approx(scipy.pvalue, abs=1e-9)
    assert report.band == pytest.approx(np.sqrt(np.log(40) / 80)) and report.m is None


def test_atoms_of_a_distribution_are_compared_on_both_sides_of_their_jump():
    distribution = charged(segar.noise.Choice([0.0, 1.0], [0.25, 0.75]))
    levels = Levels.from_entities([[Charger({segar.Charge: c})] for c in (0.0, 0.0, 1.0, 1.0)])
    assert ks_by_factor(levels, distribution, factors=[segar.Charge])["Charger.Charge"] == pytest.approx(0.25)
    between = Levels.from_entities([[Charger({segar.Charge: c})] for c in (0.5, 0.5)])
    assert ks_by_factor(between, distribution, factors=[segar.Charge])["Charger.Charge"] == pytest.approx(0.75)


def test_numbers_of_entities_have_the_distribution_of_their_slots():
    things = segar.ThingFactory({Charger: 0.3, Magnet: 0.7})
    distribution = LevelDistribution(numbers=[(things, segar.DiscreteRangeNoise(0, 2)), (Charger, 1)], min_distance=0.0)
    counts = count_distribution(distribution, Charger)
    # 0, 1 or 2 things, each a charger with probability 0.3, and one more.
    expected = [(1 + 0.7 + 0.49) / 3, (0.3 + 0.42) / 3, 0.09 / 3]
    np.testing.assert_allclose(counts.atoms[0], [1, 2, 3])
    np.testing.assert_allclose(counts.atoms[1], expected)


class OnTheDiagonal(segar.noise.Noise):
    """Of a user's, who says no distributions of its components: x and y are one number, uniform in [0, 1]."""

    width = 2
    support = ((0.0, 1.0), (0.0, 1.0))
    grid = (np.linspace(0.0, 1.0, 3),) * 2

    def sample(self, rng, size=None):
        return np.stack([np.asarray(rng.uniform(0.0, 1.0, size))] * 2, axis=-1)

    def cdf(self, x):
        return np.clip(np.asarray(x).min(axis=-1), 0.0, 1.0)


@pytest.mark.parametrize(
    "distribution",
    [
        segar.RandomEdgeLocation(),
        segar.noise.GaussianNoise2D((0.1, -0.1), (0.2, 0.3)),
        OnTheDiagonal(),
        segar.noise.Choice([(0.0, 0.5), (0.5, 0.0)]),
        segar.noise.Empirical([(0.0, 0.5), (0.5, 0.0), (0.5, 0.2)]),
        segar.noise.Affine(segar.RandomEdgeLocation(), 0.5, (0.1, -0.2)),
        segar.noise.Mixture([RandomUniformLocation(), segar.noise.CenterLocation()], [0.5, 0.5]),
    ],
)
@pytest.mark.parametrize("axis", [0, 1])
def test_a_component_of_a_distribution_on_the_plane_is_the_distribution_of_its_draws(distribution, axis):
    draws = distribution.sample(np.random.default_rng(0), 20_000)[:, axis]
    at = np.linspace(-0.9, 0.9, 19) + 1e-9
    np.testing.assert_allclose(component(distribution, axis).cdf(at), (draws[:, None] <= at).mean(axis=0), atol=0.015)


def test_a_distribution_that_says_its_joint_function_alone_has_quantiles_and_draws_of_its_components():
    distribution = component(OnTheDiagonal(), 0)
    assert distribution.icdf(0.5) == pytest.approx(0.5, abs=1e-9)
    assert distribution.sample(np.random.default_rng(0), 5).shape == (5,)


def test_a_report_tells_equal_from_different_distributions_and_names_the_factor():
    a, same, other = (
        charged(distribution).sample(200, seed=seed, split="train")
        for distribution, seed in zip(LOW_AND_HIGH[:1] * 2 + LOW_AND_HIGH[1:], (0, 1, 2), strict=True)
    )
    equal, different = (ks_report(a, b, rng=np.random.default_rng(0), resamples=99) for b in (same, other))
    assert equal.p_value > 0.05 > different.p_value == 0.01
    assert different.factors[0].name == "Charger.Charge" and different.factors[0].value > different.factors[0].band
    assert different == ks_report(a, other, rng=np.random.default_rng(0), resamples=99)
    against_law = ks_report(a, charged(LOW_AND_HIGH[1]), rng=np.random.default_rng(0), resamples=99)
    assert against_law.p_value == 0.01 and against_law.value == ks(a, charged(LOW_AND_HIGH[1]))


def test_what_cannot_be_compared_is_refused_by_name():
    distribution = segar.family("empty-easy")
    levels = distribution.sample(2, seed=0, split="train")
    with pytest.raises(LevelError, match=r"ks compares level sets .* a str is not supported"):
        ks(levels, "distribution")
    with pytest.raises(LevelError, match="distance of two distributions is exact; use ks"):
        ks_report(distribution, distribution, rng=np.random.default_rng(0))
    with pytest.raises(LevelError, match="at least 19 resamples, not 3"):
        ks_report(levels, distribution, rng=np.random.default_rng(0), resamples=3)


def test_a_factor_that_follows_others_has_no_distribution_to_compare_with():
    heavy = Prior(segar.Charge, 2.0, relation=segar.language.is_equal(segar.Mass, 1.0))
    distribution = LevelDistribution(
        numbers=[(Charger, 1)], priors=[heavy, Prior(segar.Charge, 1.0), Prior(Position, RandomUniformLocation())]
    )
    levels = distribution.sample(5, seed=0, split="train")
    with pytest.raises(LevelError, match=r"Charger has no Charge with a distribution of its own.*leave it out"):
        ks(levels, distribution)
    assert ks(levels, distribution, factors=[Position]) > 0.0
