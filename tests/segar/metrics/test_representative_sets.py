"""What a level set is worth: coverage, effective number and entropy."""

import numpy as np
import pytest

import segar
from segar import Charger, GaussianNoise, GoalTile, GolfBall, LevelDistribution, Levels, Position, Prior, UniformNoise
from segar.errors import LevelError
from segar.language import Magnet
from segar.metrics import coverage, effective_number, sample_entropy
from segar.noise import Independent

UNIT = {(GolfBall, Position): 1.0}


def balls(points) -> Levels:
    return Levels.from_entities([[GolfBall({Position: p})] for p in points])


def rng(seed: int = 0) -> np.random.Generator:
    return np.random.default_rng(seed)


def test_coverage_is_the_distance_to_the_nearest_level():
    found = coverage(balls([[0.0, 0.0], [0.5, 0.0]]), balls([[0.0, 0.1], [0.5, 0.3], [0.9, 0.0]]), scale=UNIT)
    assert found.radius == pytest.approx(0.4)
    assert found.mean == pytest.approx((0.1 + 0.3 + 0.4) / 3)
    assert found.mean < found.high <= found.radius


def test_a_set_covers_itself_and_more_levels_cover_more():
    distribution = segar.family("empty-hard")
    levels = distribution.sample(100, seed=0, split="train")
    assert coverage(levels, levels).radius == pytest.approx(0.0, abs=1e-9)
    few, many = (coverage(levels[:n], distribution, rng=rng()) for n in (5, 100))
    assert few.mean > many.mean and few.radius > many.radius


@pytest.mark.parametrize("counts", [[7], [1] * 6, [9, 1]], ids=str)
def test_clusters_of_levels_are_worth_the_exponential_of_their_entropy(counts):
    places = [[-0.9 + 0.3 * k, 0.0] for k, count in enumerate(counts) for _ in range(count)]
    shares = np.array(counts) / sum(counts)
    found = effective_number(balls(places), scale={(GolfBall, Position): 0.001}, mismatch=50.0)
    assert found == pytest.approx(np.prod(shares**-shares))


def test_the_entropy_of_independent_factors_is_that_of_their_distributions():
    place = Independent(UniformNoise(-0.5, 0.5), GaussianNoise(0.0, 0.2))
    distribution = LevelDistribution(
        numbers=[(GolfBall, 1)], priors=[Prior(Position, place), Prior(segar.Mass, UniformNoise(1.0, 3.0))]
    )
    known = place.entropy() + np.log(2.0)
    levels = distribution.sample(4000, seed=0, split="train")
    for method in ("joint", "mean_field"):
        found = sample_entropy(levels, method)
        assert found.value == pytest.approx(known, abs=0.15) == found.continuous
        assert found.discrete == found.left_out == 0.0


def test_what_is_chosen_adds_its_shannon_entropy():
    things = segar.ThingFactory({Charger: 0.25, Magnet: 0.75})
    place, charge = UniformNoise(0.0, 0.5), segar.noise.Choice([-1.0, 1.0])
    distribution = LevelDistribution(
        numbers=[(things, 1)],
        priors=[Prior(Position, Independent(place, place)), Prior(segar.Charge, charge, entity_type=Charger)],
    )
    kinds = -0.25 * np.log(0.25) - 0.75 * np.log(0.75) + 0.25 * np.log(2)
    for method in ("joint", "mean_field"):
        found = sample_entropy(distribution.sample(6000, seed=0, split="train"), method)
        assert found.discrete == pytest.approx(kinds, abs=0.03)
        assert found.continuous == pytest.approx(2 * np.log(0.5), abs=0.1)


def test_ends_of_a_clipped_distribution_are_atoms():
    distribution = LevelDistribution(
        numbers=[(GolfBall, 1)],
        priors=[Prior(Position, [0.0, 0.0]), Prior(segar.Mass, GaussianNoise(1.0, 0.5, clip=(0.5, 1.5)))],
    )
    known = GaussianNoise(1.0, 0.5, clip=(0.5, 1.5)).entropy()
    assert sample_entropy(distribution.sample(4000, seed=0, split="train")).value == pytest.approx(known, abs=0.05)


def test_dependence_lowers_the_joint_entropy_alone():
    along = rng(0).normal(size=(2000, 1)) * 0.2
    points = np.concatenate([along, along + 0.01 * rng(1).normal(size=(2000, 1))], axis=1)
    joint, mean_field = (sample_entropy(balls(points), method).value for method in ("joint", "mean_field"))
    distribution = 0.5 * np.log(2 * np.pi * np.e)
    assert joint == pytest.approx(2 * distribution + np.log(0.2) + np.log(0.01), abs=0.1)
    assert mean_field == pytest.approx(2 * distribution + 2 * np.log(0.2), abs=0.1)


def test_equal_levels_have_no_entropy():
    levels = Levels.from_entities([[GolfBall({Position: [0.1, 0.1]}), GoalTile()]] * 5)
    assert sample_entropy(levels).value == sample_entropy(levels, "mean_field").value == 0.0


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda a: sample_entropy(a, "jiont"), "unknown method 'jiont'. Did you mean 'joint'"),
        (lambda a: sample_entropy(a), "occurs more than 3 times among these 3"),
        (lambda a: coverage(a, a.distribution), "coverage of a distribution draws levels"),
        (lambda a: coverage(a, "b", rng=rng()), "coverage needs a level distribution .* not a str"),
    ],
)
def test_wrong_options_are_named(call, message):
    with pytest.raises(LevelError, match=message):
        call(segar.family("empty-hard").sample(3, seed=0, split="train"))
