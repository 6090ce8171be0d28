"""A page plays what Python plays: states, rewards, ends and what agents see agree to the bit, in two browsers."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest

import segar
from segar.levels import TASK_LEVELS, families
from segar.playground import make_playground
from tests.segar.playground import wild_world
from tests.segar.playground.browsers import Browser
from tests.segar.playground.twin_page import assert_played_alike, episodes_of

WORLDS = [*families(), *TASK_LEVELS]


@pytest.mark.slow
@pytest.mark.parametrize("name", WORLDS)
def test_a_page_of_each_world_plays_to_the_bit(name: str, browser: Browser, tmp_path: Path) -> None:
    assert_plays_alike(segar.family(name).sample(20, seed=3), ("rgb", "textures"), browser, tmp_path)


@pytest.mark.browser
@pytest.mark.parametrize("name", ["chromium", "firefox"])
def test_a_page_plays_to_the_bit(name: str, request: pytest.FixtureRequest, tmp_path: Path) -> None:
    levels = segar.family("objectsx3-hard").sample(20, seed=3)
    assert_plays_alike(levels, ("rgb", "textures"), request.getfixturevalue(name), tmp_path)


def test_own_rules_with_all_functions_and_draws_play_to_the_bit(browser: Browser, tmp_path: Path) -> None:
    rng = np.random.default_rng(2)
    things = [
        [
            segar.GolfBall({segar.Position: rng.uniform(-0.8, 0.8, 2)}),
            wild_world.Leaf({segar.Position: rng.uniform(-0.8, 0.8, 2), segar.Mass: rng.uniform(0.5, 2)}),
            segar.GoalTile({segar.Position: rng.uniform(-0.8, 0.8, 2)}),
        ]
        for _ in range(10)
    ]
    levels = segar.Levels.from_entities(things, world=wild_world.world, fix_overlaps=True)
    assert_plays_alike(levels, ("state",), browser, tmp_path)


def assert_plays_alike(levels: segar.Levels, observations: Sequence[str], browser: Browser, tmp_path: Path) -> None:
    browser.show(tmp_path, make_playground(levels, observations=observations))
    assert_played_alike(levels, observations, browser, episodes_of(levels, 20, 100, np.random.default_rng(5)))
