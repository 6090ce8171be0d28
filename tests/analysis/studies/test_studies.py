"""Studies without training: what they leave is what the library says, and hangs together."""

import pandas as pd
import pytest

from segar.analysis.studies.baselines import players
from segar.analysis.studies.hardness import hardness_with


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
