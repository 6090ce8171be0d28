"""Levels and compiled kernels that the engine's tests share: few worlds, since each takes seconds to compile once."""

from collections.abc import Callable

import numpy as np
import pytest

from segar import Ball, GoalTile, GolfBall, Levels, Position, World, family, move
from segar.engine.simulator import Simulator
from segar.language.factors import ID
from segar.rules import accelerate
from tests.segar.engine.random_rules import Author, mixed_levels
from tests.segar.engine.worlds import compiled, uncompiled


@pytest.fixture(scope="session")
def sampled() -> Callable[[str], tuple[Simulator, Levels]]:
    """The default world of a named family, compiled unless it is small, with 20 of its levels."""
    made: dict[str, tuple[Simulator, Levels]] = {}

    def get(name: str) -> tuple[Simulator, Levels]:
        if name not in made:
            levels = family(name).sample(20, seed=3)
            made[name] = (uncompiled if name == "empty-hard" else compiled)(World(), levels.layout), levels
        return made[name]

    return get


@pytest.fixture(scope="session")
def table() -> tuple[Simulator, Levels]:
    """The default world of a golf ball, three balls and a goal in a corner, in one level; its source runs as Python."""
    places = [(0.0, 0.0), (0.5, 0.0), (0.0, 0.5), (-0.5, 0.0)]
    balls = [Ball({Position: p, ID: f"ball{n}"}) for n, p in enumerate(places[1:], 1)]
    levels = Levels.from_entities([[GolfBall({Position: places[0]}), GoalTile({Position: (0.85, 0.85)}), *balls]])
    return uncompiled(World(), levels.layout), levels


@pytest.fixture(scope="session")
def mixed() -> tuple[Simulator, Levels]:
    """A compiled world of random rules on levels with mixed and optional slots.

    The seed is one whose rules take one, two and three entities, draw numbers, and combine relations.
    """
    levels = mixed_levels(np.random.default_rng(0), small=True)
    author = Author(np.random.default_rng(28))
    return compiled(World((move, accelerate, *(author.rule() for _ in range(5)))), levels.layout), levels
