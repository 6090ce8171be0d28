"""A recorded dataset that tests read, and levels whose rules draw numbers."""

import pytest

import segar
from segar.datasets import Dataset, record

LEVELS = segar.family("objectsx1-hard").sample(3, seed=0)


@segar.rule
def tremble(v: segar.Velocity) -> segar.Differential[segar.Velocity]:
    """Every body is pushed about a little, never twice in the same way."""
    return segar.Differential[segar.Velocity](
        v, segar.language.VectorValue(segar.random.normal(), segar.random.normal())
    )


@pytest.fixture(scope="session")
def levels() -> segar.Levels:
    return LEVELS


@pytest.fixture(scope="session")
def recorded(tmp_path_factory) -> Dataset:
    """Seven episodes of at most 9 steps, in shards of three; nobody writes to it."""
    return record(tmp_path_factory.mktemp("recorded") / "data", LEVELS, episodes=7, episodes_per_shard=3, max_steps=9)


@pytest.fixture
def trembling() -> segar.Levels:
    """Two levels with rules of their own, which draw numbers."""
    places = [(-0.5, 0.0), (0.5, 0.25)]
    things = [[segar.GolfBall({segar.Position: place}), segar.GoalTile({segar.Position: (0, 0.8)})] for place in places]
    return segar.Levels.from_entities(things, world=segar.World(rules=(segar.move, tremble)))
