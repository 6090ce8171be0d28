"""The named families: their constants are those of 2022, but for the swapped clips of its dampers."""

import json

import numpy as np
import pytest

import segar
from segar import Charge, Levels, Mass, Mobile, Position, Size, family
from segar.errors import LevelError
from segar.language import CIRCLE, Heat, Order
from tests.places import TESTS

HASHES = TESTS / "data/family_hashes.json"
every_family = pytest.mark.parametrize("name", segar.families())


def drawn(levels: Levels, slot: int, factor: type) -> np.ndarray:
    column = levels.layout.columns[factor]
    values = levels.sampled_values[:, slot, column : column + factor.width]
    return values[:, 0] if factor.width == 1 else values


@pytest.mark.parametrize(("name", "content_hash"), json.loads(HASHES.read_text()).items())
def test_the_content_hash_of_a_named_distribution_stays(name, content_hash):
    assert family(name).hash == content_hash


@every_family
def test_the_ball_and_the_goal_are_those_of_the_paper(name):
    levels = family(name).sample(50)
    assert (levels.values[:, 1, levels.layout.columns[Size]] == 0.4).all() and (levels.shape_kind[:, 1] == CIRCLE).all()
    assert (drawn(levels, 1, Order) == -2).all()
    assert (drawn(levels, 0, Charge) == 1).all() and (drawn(levels, 0, Mass) == 1).all()
    assert (drawn(levels, 0, Mobile) == 1).all()
    if not (name.startswith("objects") and name.endswith("hard")):
        assert (drawn(levels, 0, Size) == 0.2).all()


@pytest.mark.parametrize(
    ("wrong", "right"), [("objectx1-hard", "objectsx1-hard"), ("emptyx0-easy", "empty-easy"), ("putput", "puttputt")]
)
def test_a_misspelt_family_gets_the_nearest_name(wrong, right):
    with pytest.raises(LevelError, match=rf"there is no level family '{wrong}'. Did you mean '{right}'\?"):
        family(wrong)


@pytest.mark.parametrize("name", [f for f in segar.families() if f.startswith("hazardtiles")])
def test_hazard_tiles_burn_and_their_goal_does_not(name):
    levels = family(name).sample(200)
    assert (drawn(levels, 1, Heat) == 0).all()
    tiles = np.stack([drawn(levels, slot, Heat) for slot in range(2, len(levels.layout.slots) - 1)])
    assert (tiles >= 0.4).all()
    twin = family(name.removeprefix("hazard"))
    assert (drawn(twin.sample(200), 1, Heat) >= 0.4).all()
    places = [[laws.get(Position) for laws in one.marginals().values()] for one in (family(name), twin)]
    assert places[0] == places[1]
