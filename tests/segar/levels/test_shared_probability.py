"""How likely levels are shared: what the distributions say, against counting."""

import dataclasses

import numpy as np
import pytest

import segar
from segar import Charge, GoalTile, GolfBall, Mass, Position, Prior, UniformNoise
from segar.errors import LevelError, PriorError
from segar.levels import TASK_LEVELS, near_levels
from segar.noise import Choice, DiscreteRangeNoise, RandomTopLocation, RandomTopRightLocation
from segar.suites import suite, suites


def discrete(*extra, **changed):
    priors = [
        Prior(Position, (-0.5, -0.5), entity_type=GolfBall),
        Prior(Position, (0.5, 0.5), entity_type=GoalTile),
        *extra,
    ]
    return segar.LevelDistribution(**{"numbers": [(GolfBall, 1), (GoalTile, 1)], "priors": priors, **changed})


COINS = Prior(Mass, Choice([1.0, 2.0, 4.0], [0.5, 0.25, 0.25]), entity_type=GolfBall)


def counted(dist, n, other=None, draws=20_000, sets=20):
    """Share of levels that are among n others, with its standard error over sets."""
    found = []
    for seed in range(sets):
        train, test = dist.sample(n, seed=seed), (other or dist).sample(draws // sets, seed=seed, split="test")
        found.append(near_levels(test, train, 0.0, dist).mean())
    return np.mean(found), np.std(found, ddof=1) / sets**0.5


@pytest.mark.parametrize("n", [1, 3])
def test_a_draw_of_coins_is_among_n_others_as_often_as_one_of_them_is_it(n):
    found = discrete(COINS).shared_probability(n)
    assert found.value == pytest.approx(0.5 * (1 - 0.5**n) + 0.5 * (1 - 0.75**n)) and found.error == 0


def test_a_density_anywhere_makes_it_zero():
    assert discrete(COINS, Prior(Charge, UniformNoise(1, 2), entity_type=GolfBall)).shared_probability(10**6) == (
        0.0,
        0.0,
    )


@pytest.mark.parametrize("n", [1, 200])
def test_goals_of_empty_easy_gather_in_a_corner_as_often_as_is_counted(n):
    easy = segar.family("empty-easy")
    found = easy.shared_probability(n)
    assert found.error == 0 and easy.shared_probability().value == pytest.approx(((0.95 - 0.8 + 1e-5) / 0.475) ** 4)
    value, error = counted(easy, n, sets=100 if n == 1 else 20)
    assert abs(value - found.value) < 4 * error


def test_numbers_of_things_that_vary_are_counted():
    numbers = [(GolfBall, 1), (GoalTile, 1), (segar.Ball, DiscreteRangeNoise(0, 1))]
    dist = discrete(COINS, Prior(Position, RandomTopLocation(), entity_type=segar.Ball), numbers=numbers)
    found, (value, error) = dist.shared_probability(4), counted(dist, 4)
    assert abs(value - found.value) < 4 * error + found.error and found.error < 1e-3


def test_another_distribution_shares_what_both_can_draw():
    other = discrete(Prior(Mass, Choice([2.0, 3.0], [0.5, 0.5]), entity_type=GolfBall))
    found = discrete(COINS).shared_probability(5, other)
    assert found.value == pytest.approx(0.5 * (1 - 0.75**5))
    assert discrete(COINS).shared_probability(5, segar.family("empty-hard")).value == 0
    ground = discrete(COINS, parameters={segar.Gravity: 5.0})
    assert discrete(COINS).shared_probability(5, ground).value == 0


def test_placement_bounds_what_it_takes_off():
    two = dataclasses.replace(
        discrete(COINS),
        priors=[COINS, *(Prior(Position, RandomTopRightLocation(), entity_type=t) for t in (GolfBall, GoalTile))],
    )
    found, (value, error) = two.shared_probability(50), counted(two, 50)
    assert found.error > 0 and abs(value - found.value) <= found.error + 4 * error


@pytest.mark.parametrize("name", [*(f for f in segar.families() if f[-5:] != "-hard"), *TASK_LEVELS])
def test_named_families_say_it(name):
    found = segar.family(name).shared_probability(100)
    assert 0 <= found.value - found.error <= found.value + found.error < (0.1 if name == "empty-easy" else 1e-3)


@pytest.mark.parametrize("name", suites())
def test_test_levels_of_suites_are_no_training_levels(name):
    one = suite(name)
    found = one.train.shared_probability(one.training_levels, one.test)
    assert found.value + found.error < 1e-4


def test_wrong_numbers_and_distributions_without_an_answer_are_told():
    with pytest.raises(LevelError, match=r"must be a whole number above 0, not 0"):
        discrete(COINS).shared_probability(0)
    many = [Prior(factor, Choice([*range(1, 400)])) for factor in (Mass, Charge, segar.Magnetism)]
    with pytest.raises(PriorError, match=r"more than 200,000 kinds of levels"):
        discrete(*(dataclasses.replace(p, entity_type=GolfBall) for p in many)).shared_probability()
