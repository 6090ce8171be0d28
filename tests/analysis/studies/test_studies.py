"""Studies without training: what they leave is what the library says, and hangs together."""

import dataclasses

import numpy as np
import pandas as pd
import pytest

from segar import GoalTile, GolfBall, Position, Velocity, family
from segar.analysis.studies.baselines import players
from segar.analysis.studies.hardness import hardness_with
from segar.analysis.studies.training_sets import SEARCH_SEED, controllable, measures
from segar.hardness import plan


@pytest.fixture(scope="module")
def table():
    return pd.DataFrame(players("empty", "hard", 4)).set_index("player")


def test_the_planner_is_no_worse_than_the_script_and_better_than_chance(table):
    assert set(table.index) == {"idle", "random", "floor", "script", "oracle"}
    assert table.loc["oracle", "return"] >= table.loc["script", "return"] > table.loc["random", "return"]
    assert table.loc["oracle", "success"] == 1.0


def test_the_floor_is_the_better_of_idle_and_random_play_on_each_level(table):
    both = table.loc[["idle", "random"]]
    for value in ("return", "success"):
        assert table.loc["floor", value] >= both[value].max()
    # Idle play solves no level, and is better than chance on some: the returns are of two players, success of one.
    assert table.loc["floor", "success"] == table.loc["random", "success"]
    assert both["return"].max() < table.loc["floor", "return"] < table.loc["oracle", "return"]


@pytest.mark.slow
def test_a_slow_arrival_is_hard_for_chance_and_not_for_the_planner():
    row = hardness_with(1, 2)
    assert row["random_success"] < 0.2 < row["oracle_success"] == 1.0
    assert row["random_low"] <= row["random_success"] <= row["random_high"]


@pytest.mark.compiled
def test_measures_of_play_are_of_what_is_done_and_of_what_becomes_of_it():
    dist = family("objectsx1-medium")
    levels = dist.sample(20, seed=5)
    best, moved = plan(levels, rng=np.random.default_rng(SEARCH_SEED)), controllable(levels)
    assert {(GolfBall, Position), (GolfBall, Velocity)} <= moved and (GoalTile, Position) not in moved
    same, of_play = measures(levels, levels, 0.0, best, moved), ["w1_policy", "w2_response", "w2_uncontrollable"]
    assert {name: same[name] for name in of_play} == dict.fromkeys(of_play, 0.0)
    one, found = levels[:1], {}
    best, x = plan(one, rng=np.random.default_rng(SEARCH_SEED)), levels.layout.columns[Position]
    for moves in (GolfBall, GoalTile):
        values = one.values.copy()
        values[one.types == one.layout.types.index(moves), x] *= -1
        found[moves] = measures(dataclasses.replace(one, values=values), one, 0.0, best, moved)
        assert found[moves]["w1_policy"] > 0.1
    assert found[GolfBall]["w2_uncontrollable"] == 0.0 < found[GoalTile]["w2_uncontrollable"]
