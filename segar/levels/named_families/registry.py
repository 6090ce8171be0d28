"""The named level distributions, with the constants of 2022: 21 families of PuttPutt levels, and the tasks' own."""

from __future__ import annotations

from functools import cache
from typing import Any

from segar.errors import LevelError, did_you_mean
from segar.language import (
    Ball,
    Bumper,
    Charge,
    Charger,
    Circle,
    Damper,
    FireTile,
    Friction,
    GoalTile,
    GolfBall,
    Heat,
    Hole,
    MagmaTile,
    Magnet,
    Magnetism,
    Mass,
    Mobile,
    Object,
    Position,
    RandomConvexHull,
    SandTile,
    Shape,
    Size,
    StoredEnergy,
    ThingFactory,
    Tile,
)
from segar.levels.distribution import LevelDistribution
from segar.levels.named_families import billiards, invisiball, puttputt
from segar.levels.priors import Prior
from segar.noise import (
    CenterLocation,
    GaussianMixtureNoise,
    GaussianNoise,
    RandomBottomLocation,
    RandomMiddleLocation,
    RandomTopLocation,
    RandomTopRightLocation,
    RandomUniformLocation,
    UniformNoise,
)

DIFFICULTIES = ("easy", "medium", "hard")
TASKS = ("empty", "objectsx1", "objectsx2", "objectsx3", "tilesx1", "tilesx2", "tilesx3")
TASK_LEVELS = ("puttputt", "puttputt-random-middle", "billiards", "invisiball")
OBJECTS = ThingFactory([Charger, Magnet, Bumper, Damper, Ball])
TILES = ThingFactory([SandTile, MagmaTile, Hole, FireTile])

# Where ball, goal and the other things start.
LOCATIONS = {
    "easy": (CenterLocation(), RandomTopRightLocation(), RandomTopLocation()),
    "medium": (RandomBottomLocation(), RandomTopLocation(), RandomMiddleLocation()),
    "hard": (RandomUniformLocation(), RandomUniformLocation(), RandomUniformLocation()),
}
SMALL_SIZE = GaussianNoise(0.2, 0.01, clip=(0.1, 0.3))
# The size of a tile that a prior draws reaches only the W2 metric, never the shape (decision 0003).
TILE_SIZE = GaussianNoise(1.0, 0.01, clip=(0.5, 1.5))
TILE_SIZES = {("tiles", "hard"): SMALL_SIZE, ("objects", "hard"): 0.3}


def families() -> tuple[str, ...]:
    """Names of the 21 families: task x difficulty."""
    return tuple(f"{task}-{difficulty}" for task in TASKS for difficulty in DIFFICULTIES)


@cache
def family(name: str) -> LevelDistribution:
    """The level distribution of that name: one of :func:`families`, or default levels of a task.

    These are ``"puttputt"`` (the paper's listing), ``"puttputt-random-middle"``, ``"billiards"`` and ``"invisiball"``.

    Raises:
        LevelError: there is no such distribution; the message says the nearest name.
    """
    if name in TASK_LEVELS:
        return LevelDistribution(**_task_config(name), name=name)
    if name not in families():
        raise LevelError(f"there is no level family '{name}'.{did_you_mean(str(name), [*families(), *TASK_LEVELS])}")
    task, difficulty = name.split("-")
    kind, _, count = task.partition("x")
    numbers: list = [(GolfBall, 1), (GoalTile, 1)]
    if kind != "empty":
        numbers.append((OBJECTS if kind == "objects" else TILES, int(count)))
    extra = {"empty": (), "objects": _object_priors(difficulty), "tiles": _tile_priors(difficulty)}[kind]
    return LevelDistribution(numbers, [*_common_priors(kind, difficulty), *extra], name=name)


def _task_config(name: str) -> dict[str, Any]:

    return {
        "puttputt": puttputt.puttputt_default_config,
        "puttputt-random-middle": puttputt.puttputt_random_middle_config,
        "billiards": billiards.billiards_default_config,
        "invisiball": invisiball.invisiball_default_config,
    }[name]


def _common_priors(kind: str, difficulty: str) -> list[Prior]:
    ball, goal, others = LOCATIONS[difficulty]
    crowd = {"empty": (), "objects": (Object,), "tiles": (Tile,)}[kind]
    return [
        *(Prior(Position, others, entity_type=thing) for thing in crowd),
        Prior(Position, ball, entity_type=GolfBall),
        Prior(Position, goal, entity_type=GoalTile),
        Prior(Shape, RandomConvexHull(0.3), entity_type=Tile),
        Prior(Shape, Circle(0.4), entity_type=GoalTile),
        Prior(Size, TILE_SIZES.get((kind, difficulty), TILE_SIZE), entity_type=Tile),
    ]


def _object_priors(difficulty: str) -> list[Prior]:
    if difficulty == "easy":
        return []
    # In 2022 the ends of the dampers' clips were swapped, so all had the energy -1; this is what was meant.
    spread, bumper, damper = {
        "medium": (0.1, GaussianNoise(1.0, 0.1, clip=(0.5, 1.0)), GaussianNoise(-1.0, 0.1, clip=(-1.0, -0.5))),
        "hard": (0.4, GaussianNoise(1.0, 0.4, clip=(0.0, 1.0)), GaussianNoise(-1.0, 0.4, clip=(-1.0, -0.5))),
    }[difficulty]
    plus_or_minus_one = GaussianMixtureNoise(means=[-1.0, 1.0], stds=[spread, spread])
    priors = [
        Prior(Charge, plus_or_minus_one, entity_type=Charger),
        Prior(Magnetism, plus_or_minus_one, entity_type=Magnet),
        Prior(StoredEnergy, bumper, entity_type=Bumper),
        Prior(StoredEnergy, damper, entity_type=Damper),
    ]
    if difficulty == "hard":
        priors += [Prior(Size, SMALL_SIZE, entity_type=Object), Prior(Mass, 1.0), Prior(Mobile, True)]
    return priors


def _tile_priors(difficulty: str) -> list[Prior]:
    law = UniformNoise(0.4, 1.0) if difficulty == "hard" else UniformNoise(0.5, 0.55)
    return [Prior(Mass, 1.0), Prior(Mobile, True), Prior(Friction, law), Prior(Heat, law)]
