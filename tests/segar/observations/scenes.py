"""Levels for tests of renderers: anything anywhere, whole or partly outside the arena, and frames of them."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from segar import Ball, Charger, Damper, FireTile, GoalTile, Hole, Magnet, Mobile, Position, SandTile, Size, World
from segar.language import CIRCLE, HULL, Bumper, Floor, GlobalFriction, Layout, MagmaTile, Order, RandomConvexHull, Slot
from segar.levels.level_data import Provenance
from segar.observations.pixels.solid_colours import Pixels
from segar.textures import TextureSet

ANYTHING = (Charger, Magnet, Bumper, Damper, Ball, SandTile, MagmaTile, Hole, FireTile)


@dataclass
class Scene:
    """The arrays of a level set that a renderer reads."""

    layout: Layout
    types: np.ndarray
    shape_kind: np.ndarray
    vertex_count: np.ndarray
    vertices: np.ndarray
    values: np.ndarray
    provenance: Provenance
    world: World | None = None


def scene(*slots: tuple[type, ...], n: int = 1, seed: int = 0, hulls: bool = True) -> Scene:
    """``n`` random levels with one entity per tuple of types; things may lie anywhere, partly outside the arena."""
    rng = np.random.default_rng(seed)
    layout = Layout((*(Slot(f"thing{i}", s) for i, s in enumerate(slots)), Slot("global_friction", (GlobalFriction,))))
    shape = (n, len(layout.slots))
    found = Scene(layout, np.full(shape, -1, np.int16), np.zeros(shape, np.int8), np.zeros(shape, np.int16),
                  np.zeros((*shape, 30, 2)), np.full((*shape, layout.width), np.nan),
                  Provenance(None, "", "", seed, "", np.arange(n)))  # fmt: skip
    for i, e in np.ndindex(shape):
        kind = layout.slots[e].types[rng.integers(len(layout.slots[e].types))]
        found.types[i, e] = layout.types.index(kind)
        for factor, value in kind.declared.items():
            if factor.width:
                column = layout.columns[factor]
                found.values[i, e, column : column + factor.width] = value
        if kind is GlobalFriction:
            continue
        found.shape_kind[i, e] = HULL if hulls and Floor in kind.declared and kind is not GoalTile else CIRCLE
        if found.shape_kind[i, e] == HULL:
            hull = RandomConvexHull(0.3).sample(rng, 1)[0]
            found.vertices[i, e, : len(hull)], found.vertex_count[i, e] = hull, len(hull)
        put(found, i, e, Position, rng.uniform(-1.1, 1.1, 2))
        put(found, i, e, Size, rng.uniform(0.02, 0.5))
        put(found, i, e, Order, rng.integers(-2, 4))
        if Mobile in kind.declared:
            put(found, i, e, Mobile, rng.integers(2))
    return found


def put(scene: Scene, level: int, entity: int, factor: type, value: object) -> None:
    column = scene.layout.columns[factor]
    scene.values[level, entity, column : column + factor.width] = value


def draw(scene: Scene, pixels: Any = None, key: Any = None) -> np.ndarray:
    """One frame per level, in episodes of these keys."""
    n = len(scene.values)
    bound = start(scene, pixels or Pixels(), np.arange(n, dtype=np.uint64) if key is None else key)
    return frames_of(bound, scene)


def start(scene: Scene, pixels: Any, key: np.ndarray) -> Any:
    """The observation with one episode on each level."""
    n = len(scene.values)
    bound = pixels.bind(scene, n)
    if hasattr(bound, "start"):
        bound.start(key, np.arange(n), np.ones(n, bool))
    bound.begin(scene.values, np.arange(n), np.ones(n, bool))
    return bound


def frames_of(bound: Any, scene: Scene) -> np.ndarray:
    """What the environments of all levels show now."""
    n = len(scene.values)
    frames = np.full((n, *bound.space.shape), 7, np.uint8)
    bound.write(scene.values, np.arange(n), frames, np.arange(n))
    return frames


INPUTS = (
    "background",
    "Heat",
    "Friction",
    "Charge",
    "Magnetism",
    "StoredEnergy",
    "Mass",
    "GoalTile",
    "noise_1",
    "noise_2",
)


def random_textures(models: int = 1, period: int = 3, squash: str = "tanh", seed: int = 0) -> TextureSet:
    """Textures nobody trained, whose inputs have scales and shifts of all kinds."""
    rng = np.random.default_rng(seed)
    shape = (models, len(INPUTS), period, period, 3)
    no_shift = np.array([name == "background" or name.startswith("noise") for name in INPUTS])
    return TextureSet(
        "random",
        INPUTS,
        rng.normal(0.0, 0.7, shape),
        rng.normal(0.0, 0.3, (models, *shape[2:])),
        np.where(no_shift, 0.0, rng.normal(0.0, 0.3, len(INPUTS))),
        rng.uniform(0.5, 1.5, len(INPUTS)),
        squash,
    )
