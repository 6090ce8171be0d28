"""What the site's pages say of environments and suites is what measuring them again gives."""

import importlib.util
import io
import json

import pandas as pd
import pytest

import segar
from segar.levels import TASK_LEVELS
from segar.suites import suite, suites
from tests.places import ROOT

SPEC = importlib.util.spec_from_file_location("measure", ROOT / "docs" / "site" / "measure.py")
measure = importlib.util.module_from_spec(SPEC)
SPEC.loader.exec_module(measure)
CARDS = json.loads(measure.CARDS.read_text(encoding="utf-8"))
HARDNESS = pd.read_csv(measure.HARDNESS)


def test_every_suite_has_the_card_of_what_it_is_now():
    assert [*CARDS] == [*suites()]
    for name, card in CARDS.items():
        of = suite(name)
        assert (card["hash"], card["axis"], card["test_levels"]) == (of.hash, of.axis, len(of.test_levels))


def test_every_environment_was_measured_with_players_that_make_sense():
    assert [*HARDNESS.environment.unique()] == [*segar.families(), *TASK_LEVELS]
    assert (HARDNESS.low <= HARDNESS.success).all() and (HARDNESS.success <= HARDNESS.high).all()
    solved = HARDNESS.pivot_table(index="environment", columns="player", values="success", dropna=False)
    assert (solved.oracle >= solved.random).all() and (solved.oracle >= solved.scripted.fillna(0)).all()


@pytest.mark.results
@pytest.mark.parametrize("name", ["empty-easy", "hazardtilesx1-hard"])
def test_an_environment_is_as_hard_as_its_page_says(name):
    again = io.StringIO(pd.DataFrame(measure.hardness_of(name)).to_csv(index=False, float_format="%.6g"))
    shipped = HARDNESS[HARDNESS.environment == name].reset_index(drop=True)
    pd.testing.assert_frame_equal(pd.read_csv(again), shipped, check_dtype=False)


@pytest.mark.results
@pytest.mark.parametrize("name", ["place-few-v1", "goal-bank-v1"])
def test_a_card_is_made_again(name):
    assert json.loads(json.dumps(measure.card_of(name))) == CARDS[name]
