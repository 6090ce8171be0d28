"""A recorded dataset that tests read, and levels whose rules draw numbers."""

from typing import Any

import pytest

import segar
from segar.datasets import record

OPTIONS: dict[str, Any] = {"episodes": 7, "batch": 3, "max_steps": 9}


@segar.rule
def tremble(v: segar.Velocity) -> segar.Differential[segar.Velocity]:
    """Every body is pushed about a little, never twice in the same way."""
    return segar.Differential[segar.Velocity](
        v, segar.language.VectorValue(segar.random.normal(), segar.random.normal())
    )


@pytest.fixture(autouse=True)
def root(tmp_path, monkeypatch):
    """Where Minari keeps the datasets of a test."""
    monkeypatch.setenv("MINARI_DATASETS_PATH", str(tmp_path / "minari"))
    return tmp_path / "minari"


@pytest.fixture(scope="session")
def levels() -> segar.Levels:
    return segar.family("objectsx1-hard").sample(3, seed=0)


@pytest.fixture(scope="session")
def recorded(tmp_path_factory, levels) -> Any:
    """Seven episodes of at most 9 steps, in batches of three; nobody writes to it."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("MINARI_DATASETS_PATH", str(tmp_path_factory.mktemp("recorded")))
        return record("segar/objectsx1-hard-v0", levels, **OPTIONS)


@pytest.fixture
def trembling() -> segar.Levels:
    """Two levels with rules of their own, which draw numbers."""
    places = [(-0.5, 0.0), (0.5, 0.25)]
    things = [[segar.GolfBall({segar.Position: place}), segar.GoalTile({segar.Position: (0, 0.8)})] for place in places]
    return segar.Levels.from_entities(things, world=segar.World(rules=(segar.move, tremble)))
