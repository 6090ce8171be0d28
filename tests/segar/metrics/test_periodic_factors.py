"""Factors that come round again, such as headings: distances between levels take the shorter way."""

import math

import numpy as np
import pytest

import segar
from segar import GoalTile, GolfBall, LevelDistribution, Levels, Parameter, Position, Prior
from segar.errors import FactorError
from segar.metrics import decompose, embed, ks, ks_by_factor, ks_report, mmd_test, sample_entropy, spread, w2
from segar.noise import VonMises


class Heading(segar.Scalar, unit="rad", period=math.tau): ...


class Wind(Parameter, period=360.0): ...


class Arrow(segar.Object):
    heading: Heading = 0.0


def arrows(*headings: float) -> Levels:
    return Levels.from_entities([[Arrow({Position: [0.0, 0.0], Heading: h})] for h in headings])


def distribution(mean: float, kappa: float = 8.0) -> LevelDistribution:
    priors = [Prior(Position, segar.RandomUniformLocation()), Prior(Heading, VonMises(mean, kappa))]
    return LevelDistribution([(Arrow, 1)], priors)


UNIT = {(Arrow, Heading): 1.0}


def test_the_exact_distance_goes_the_shorter_way_round():
    a, b = arrows(3.0, 0.1), arrows(-3.0, 0.2 + 2 * math.tau)
    expected = math.sqrt(((math.tau - 6.0) ** 2 + 0.1**2) / 2)
    assert w2(a, b, scale=UNIT) == pytest.approx(expected) == decompose(a, b, scale=UNIT).value
    assert decompose(a, b, scale=UNIT).by_name["Arrow.Heading"] == pytest.approx(expected**2)
    assert w2(a, b, mode="paper") > 6.0  # as in the paper, which knows no angles


def test_a_world_parameter_may_come_round_too():
    entities = [[GolfBall({Position: [0, 0]}), GoalTile({Position: [0.5, 0.5]})]]
    a, b = (Levels.from_entities(entities, parameters={Wind: degrees}) for degrees in (350.0, 20.0))
    assert w2(a, b, scale={(Parameter, Wind): 1.0}) == pytest.approx(30.0)
    assert decompose(a, b, scale={(Parameter, Wind): 1.0}).by_name["world.Wind"] == pytest.approx(900.0)


def test_the_spread_of_directions_is_that_around_the_mean_direction():
    towards_west = distribution(math.pi).sample(2000)
    assert spread(towards_west)[Arrow, Heading] == pytest.approx(math.sqrt(VonMises(0.0, 8.0).var), rel=0.05)
    apart = spread(arrows(math.pi - 0.1), arrows(-math.pi + 0.1))[Arrow, Heading]
    assert apart == pytest.approx(0.1)


def test_vectors_stand_on_a_circle():
    (vectors,) = embed(arrows(0.0, math.pi, math.tau, -math.pi), scale=UNIT)
    assert np.linalg.norm(vectors[0] - vectors[2]) < 1e-12 > np.linalg.norm(vectors[1] - vectors[3])
    assert np.linalg.norm(vectors[0] - vectors[1]) == pytest.approx(2.0)


def test_whole_turns_make_no_difference_to_any_test():
    a = distribution(math.pi).sample(60)
    turned = Levels.from_entities(
        [
            [Arrow({Position: p, Heading: h + math.tau})]
            for p, h in zip(*columns(distribution(math.pi).sample(60)), strict=True)
        ]
    )
    assert ks(a, turned) <= 1 / 60 + 1e-12  # a turn rounds, so that each level may come a little before its twin
    assert mmd_test(a, turned, rng=np.random.default_rng(0)).value < 1e-6
    assert sample_entropy(a, factors=[Heading]).value == pytest.approx(sample_entropy(turned, factors=[Heading]).value)


def columns(levels: Levels) -> tuple[np.ndarray, np.ndarray]:
    x, h = (levels.layout.columns[f] for f in (Position, Heading))
    return levels.values[:, 0, x : x + 2], levels.values[:, 0, h]


def test_a_sample_is_near_its_distribution_wherever_the_distribution_is_cut():
    for mean in (0.0, math.pi, 40.0):
        dist = distribution(mean)
        assert ks_by_factor(dist.sample(3000), dist)["Arrow.Heading"] < 1.95 / math.sqrt(3000)
    assert ks_by_factor(distribution(0.3), distribution(0.3 + 2 * math.tau))["Arrow.Heading"] < 1e-12
    assert (
        ks_report(distribution(0.0).sample(100), distribution(1.0), rng=np.random.default_rng(0)).factors[0].name
        == "Arrow.Heading"
    )


@pytest.mark.parametrize("options", [{"base": segar.Scalar, "period": -1.0}, {"base": segar.Vector, "period": 1.0}])
def test_a_period_is_positive_and_for_one_number(options):
    with pytest.raises(FactorError, match="a period is a positive number, and for factors of one number"):
        type("Odd", (options.pop("base"),), {}, **options)
