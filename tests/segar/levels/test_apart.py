"""Levels that are drawn apart from others."""

import dataclasses

import numpy as np
import pytest

import segar
from segar import GoalTile, GolfBall, Position, Prior, RandomUniformLocation
from segar.errors import LevelError
from segar.language import Order
from segar.noise import Choice, DiscreteRangeNoise
from segar.rules.templates import dynamics_space

COINS = segar.LevelDistribution(
    numbers=[(GolfBall, 1), (GoalTile, 1)],
    priors=[
        Prior(Position, (-0.5, -0.5), entity_type=GolfBall),
        Prior(Position, (0.5, 0.5), entity_type=GoalTile),
        Prior(segar.Mass, Choice([1.0, 2.0, 3.0, 4.0]), entity_type=GolfBall),
    ],
)
"""Four levels, but for the order of drawing."""


def masses(levels):
    return levels.values[:, 0, levels.layout.columns[segar.Mass]]


def test_without_others_nothing_changes():
    dist = segar.family("tilesx2-hard")
    far = segar.family("empty-hard").sample(3)
    assert dist.sample(20, seed=3) == dist.sample(20, seed=3, apart_from=far)


def test_levels_that_others_have_are_passed_over_in_order():
    some = COINS.sample(200, seed=1)
    ones = some[np.flatnonzero(masses(some) == 1.0)[:1]]
    found = COINS.sample(40, seed=5, split="test", apart_from=ones)
    assert set(masses(found)) == {2.0, 3.0, 4.0}
    every = COINS.sample(200, seed=5, split="test")
    expected = np.flatnonzero(masses(every) != 1.0)[:40]
    np.testing.assert_array_equal(found.provenance.indices, expected)
    assert found == every[expected]
    assert COINS.sample(7, seed=5, split="test", apart_from=ones) == found[:7]  # fewer are the first of more


def test_the_order_of_drawing_makes_no_other_level():
    some = COINS.sample(1)
    values = some.values.copy()
    values[0, 0, some.layout.columns[Order]] += 1
    again = dataclasses.replace(some, values=values)
    assert masses(some)[0] not in masses(COINS.sample(30, seed=2, apart_from=again))


def test_a_distribution_that_has_no_other_levels_says_how_many_were_tried():
    every = COINS.sample(100)
    with pytest.raises(LevelError, match="of 1100 levels only 0 lie apart from the 100 levels"):
        COINS.sample(10, seed=1, apart_from=every)


@pytest.mark.parametrize("within", [0.01, 0.3])
def test_no_number_is_nearer_than_the_distance_and_those_left_out_are(within):
    dist = segar.LevelDistribution(
        numbers=[(GolfBall, 1), (GoalTile, 1)], priors=[Prior(Position, RandomUniformLocation())]
    )
    others, plain = dist.sample(300, split="test"), dist.sample(400, seed=1)
    taken = dist.sample(100, seed=1, apart_from=others, within=within)
    x, unit = dist.layout.columns[Position], segar.metrics.spread(dist)[GolfBall, Position]
    places = [one.values[:, :2, x : x + 2].reshape(len(one), 4) / unit for one in (plain, others)]
    nearest = np.abs(places[0][:, None] - places[1][None]).max(axis=2).min(axis=1)
    np.testing.assert_array_equal(taken.provenance.indices, np.flatnonzero(nearest > within)[:100])


@pytest.mark.parametrize("name", ["objectsx2-hard", "tilesx3-medium", "puttputt-random-middle", "invisiball"])
def test_a_level_is_never_apart_from_itself(name):
    dist = segar.family(name)
    levels = dist.sample(30, seed=4)
    found = dist.sample(30, seed=4, apart_from=levels)
    assert not set(found.provenance.indices) & set(range(30))
    assert dist.sample(30, seed=4, apart_from=levels[10:])[:10] == levels[:10]


def test_levels_of_other_entities_or_numbers_of_them_are_far_apart():
    few, many = (
        segar.LevelDistribution(
            numbers=[(GolfBall, 1), (GoalTile, 1), (segar.Ball, DiscreteRangeNoise(*counts))],
            priors=[Prior(Position, RandomUniformLocation())],
        )
        for counts in ((1, 2), (0, 2))
    )
    assert few.sample(20, apart_from=many.sample(50)) == few.sample(20)


def test_rule_sets_and_world_parameters_count():
    dist = segar.family("empty-hard").with_rules(dynamics_space())
    levels = dist.sample(10)
    other_rules = dataclasses.replace(levels, parameters=np.roll(levels.parameters, 1, axis=0))
    assert dist.sample(10, apart_from=other_rules) == levels
    assert not set(dist.sample(10, apart_from=levels).provenance.indices) & set(range(10))


@pytest.mark.parametrize(
    ("wrong", "message"),
    [
        ({"apart_from": [1]}, "apart_from takes levels"),
        ({"within": -1.0}, "within must be a finite number"),
        ({"within": float("nan")}, "within must be a finite number"),
        ({"within": True}, "within must be a finite number"),
    ],
)
def test_wrong_arguments_are_told(wrong, message):
    with pytest.raises(LevelError, match=message):
        COINS.sample(2, **{"apart_from": COINS.sample(1), **wrong})
