"""The names of the suites that come with SEGAR, and the axes that they stand on; no file of a suite is read."""

from collections.abc import Mapping
from functools import cache
from pathlib import Path

AXES: Mapping[str, str] = {
    "place": "where things are",
    "number": "how many objects and tiles there are",
    "kind": "which things meet",
    "property": "mass, charge and size of things",
    "world": "gravity, friction of the floor",
    "rules": "which rules hold, with which constants",
    "look": "textures",
    "sight": "what the agent does not see",
    "goal": "what the goal asks for, and how it moves",
}
"""In what training and test of a suite differ, and what that is."""

CORE = (
    "place-few-v1",
    "place-between-v1",
    "place-edge-to-middle-v1",
    "number-more-v1",
    "kind-unseen-pairs-v1",
    "property-heavy-v1",
    "property-charge-v1",
    "world-slippery-v1",
    "rules-constants-v1",
    "look-far-v1",
    "sight-mass-v1",
    "goal-moves-v1",
)
"""The suites that stand for all where time is short: twelve, at least one of each axis."""

DATA = Path(__file__).parent / "data"
SUFFIX = ".toml"
SIDES = ("train", "test")


@cache
def suites() -> tuple[str, ...]:
    """The names of all suites that come with SEGAR, in the order of their axes."""
    axes = list(AXES)
    names = sorted(path.stem for path in DATA.glob(f"*{SUFFIX}"))
    return tuple(sorted(names, key=lambda name: axes.index(name.split("-")[0])))
