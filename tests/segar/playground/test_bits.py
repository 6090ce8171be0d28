"""A page plays what Python plays: states, rewards, ends and what agents see agree to the bit, in two browsers."""

from pathlib import Path

import numpy as np
import pytest

import segar
from segar.levels import TASK_LEVELS, families
from segar.playground import make_playground
from tests.segar.playground.browsers import Browser
from tests.segar.playground.twin_page import episodes_of, play_in, play_natively

WORLDS = [*families(), *TASK_LEVELS]
QUICK = {"objectsx3-hard", "billiards"}


@pytest.mark.parametrize("name", [pytest.param(n, marks=() if n in QUICK else pytest.mark.slow) for n in WORLDS])
def test_a_page_plays_to_the_bit(name: str, browser: Browser, tmp_path: Path) -> None:
    levels = segar.family(name).sample(20, seed=3)
    observations = ("rgb", "textures")
    make_playground(levels, observations=observations).save(tmp_path / "page.html")
    browser.open(tmp_path / "page.html")
    episodes = episodes_of(levels, 20, 100, np.random.default_rng(5))
    found, expected = play_in(browser, episodes), play_natively(levels, observations, episodes)
    assert sum(len(one["told"]) for one in expected) > 300
    for k, (mine, theirs) in enumerate(zip(expected, found, strict=True)):
        assert (k, mine) == (k, theirs)
