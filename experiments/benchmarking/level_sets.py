"""The levels that a piece of a row is played on: training levels, test levels, and the causal twins of the test levels."""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from segar.experiments.benchmarking.protocol import CONTROL, REFERENCES, TWIN
from segar.experiments.benchmarking.row import Method
from segar.experiments.settings import ENDLESS
from segar.levels import Levels, hash_of_levels
from segar.suites import Suite, looks_like, suite, twins


@dataclass(frozen=True, eq=False)
class LevelSet:
    """Levels that an agent plays, one after the other.

    Attributes:
        numbers: the number of each level, int64 ``(n,)``; a twin has that of its test level.
        side: ``"train"`` or ``"test"``, as whose levels they look.
    """

    levels: Levels
    numbers: np.ndarray
    side: str


def sets_of(suite: Suite, seed: int, count: int | None = None, with_twins: bool = False) -> dict[str, LevelSet]:
    """The level sets of a suite with a seed, by name: ``"train"``, as many levels as the suite says unless ``count`` does;
    ``"test"``; and, if asked for, the twins of the test levels, as of :func:`twin_sets`."""
    sides = {"train": suite.sample(seed, count), "test": suite.test_levels}
    found = {side: LevelSet(levels, np.arange(len(levels)), side) for side, levels in sides.items()}
    return found | (twin_sets(suite.name, suite.hash) if with_twins else {})


@lru_cache(maxsize=64)
def twin_sets(name: str, hashed: str) -> dict[str, LevelSet]:
    """The twins of a suite: ``"twin-<group>"`` where training and test differ in the group, ``"control-<group>"`` where they do
    not. There are none where training and test have one distribution. They are made once in a process."""
    of = suite(name)
    assert of.hash == hashed
    made = twins(of)
    return {
        f"{TWIN if one.differs else CONTROL}{one.group}": LevelSet(
            one.levels[np.flatnonzero(one.found)], np.flatnonzero(one.found), looks_like(of, one)
        )
        for one in (made.groups if made.differing else ())
        if one.found.any()
    }


def hashes_of(sets: Mapping[str, LevelSet]) -> dict[str, str]:
    """The hash of each level set."""
    return {name: hash_of_levels(one.levels) for name, one in sets.items()}


def plays_twins(method: Method) -> bool:
    """Whether a method plays twins: all but the references do, whose failures nobody asks about."""
    return method.name not in REFERENCES


def number_of_levels(method: Method) -> int | None:
    """How many training levels an agent of a method is played on; None: as many as the suite says, as of endless ones."""
    count = method.settings.get("training_levels")
    return None if count == ENDLESS else count
