"""Pixels against a plain numpy renderer, and the laws of what is drawn over what."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pytest

from segar.engine.layout import Layout, Slot
from segar.entities import (
    Ball,
    Bumper,
    Charger,
    CueBall,
    Damper,
    FireTile,
    GlobalFriction,
    GoalTile,
    GolfBall,
    Hole,
    MagmaTile,
    Magnet,
    SandTile,
)
from segar.errors import FactorError, SegarError
from segar.factors import Charge, Floor, Magnetism, Mobile, Order, Position, Size, Visible
from segar.observations.colours import COLOURS, FLOOR, Colour, colour_of
from segar.observations.pixels import Pixels
from segar.observations.protocol import BoundObservation, Observation
from segar.shapes import CIRCLE, HULL, RandomConvexHull

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


def scene(*slots: tuple[type, ...], n: int = 1, seed: int = 0, hulls: bool = True) -> Scene:
    """``n`` random levels with one entity per tuple of types; things may lie anywhere, partly outside the arena."""
    rng = np.random.default_rng(seed)
    layout = Layout((*(Slot(f"thing{i}", s) for i, s in enumerate(slots)), Slot("global_friction", (GlobalFriction,))))
    shape = (n, len(layout.slots))
    found = Scene(layout, np.full(shape, -1, np.int16), np.zeros(shape, np.int8), np.zeros(shape, np.int16),
                  np.zeros((*shape, 30, 2)), np.full((*shape, layout.width), np.nan))  # fmt: skip
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


def draw(scene: Scene, pixels: Pixels | None = None) -> np.ndarray:
    """One frame per level."""
    pixels = pixels or Pixels()
    n = len(scene.values)
    bound = pixels.bind(scene, n)
    frames = np.zeros((n, *bound.space.shape), np.uint8)
    bound.begin(scene.values, np.arange(n), np.ones(n, bool))
    bound.write(scene.values, np.arange(n), frames, np.arange(n))
    return frames


def draw_plainly(scene: Scene, level: int, resolution: int = 64) -> np.ndarray:
    """The same frame by masks over all pixels."""
    frame = np.empty((resolution, resolution, 3), np.uint8)
    frame[:] = FLOOR
    rows, columns = np.mgrid[:resolution, :resolution]
    values, layout = scene.values[level], scene.layout
    read = {f: lambda e, f=f: values[e, layout.columns[f]] for f in layout.factors}
    things = [e for e in range(len(values)) if layout.types[scene.types[level, e]] is not GlobalFriction]
    things = sorted((e for e in things if read[Visible](e) > 0), key=lambda e: read[Order](e))
    is_tile = {e: Floor in layout.types[scene.types[level, e]].declared for e in things}
    for e in [e for e in reversed(things) if is_tile[e]] + [e for e in things if not is_tile[e]]:
        x, y = values[e, layout.columns[Position] :][:2]
        if scene.shape_kind[level, e] == CIRCLE:
            px = np.rint((x + 1) * resolution / 2)
            py = resolution - np.rint((y + 1) * resolution / 2)
            r = np.rint(read[Size](e) / 2 * resolution / 2)

            def within(rows, columns, px=px, py=py, r=r):
                return (columns - px) ** 2 + (rows - py) ** 2 <= r * (r + 1)

            filled = within(rows, columns)
            inner = filled.copy()
            for dy, dx in ((0, 1), (0, -1), (1, 0), (-1, 0)):
                inner &= within(rows + dy, columns + dx)
        else:
            corners = scene.vertices[level, e, : scene.vertex_count[level, e]]
            edges = np.roll(corners, -1, axis=0) - corners
            wx, wy = columns / (resolution / 2) - 1.0 - x, (resolution - rows) / (resolution / 2) - 1.0 - y
            depth = np.min(
                [(ex * (wy - ay) - ey * (wx - ax)) / np.sqrt(ex * ex + ey * ey)
                 for (ax, ay), (ex, ey) in zip(corners, edges, strict=True)], axis=0
            )  # fmt: skip
            filled, inner = depth >= 0, depth * (resolution / 2) >= 1
        colour = colour_of(layout.types[scene.types[level, e]])
        rgb = np.array(colour.low, float)
        if colour.factor is not None:
            low, high = colour.span
            rgb += np.clip((read[colour.factor](e) - low) / (high - low), 0, 1) * (np.array(colour.high) - rgb)
        outlined = is_tile[e] or read[Mobile](e) > 0
        frame[filled] = 0 if outlined else np.rint(rgb)
        if outlined:
            frame[inner] = np.rint(rgb)
    return frame


@pytest.mark.parametrize("resolution", [32, 64, 100])
def test_frames_equal_those_of_a_plain_renderer(resolution):
    levels = scene((GolfBall,), (GoalTile,), *[ANYTHING] * 5, n=60, seed=resolution)
    frames = draw(levels, Pixels(resolution=resolution))
    for level in range(60):
        np.testing.assert_array_equal(frames[level], draw_plainly(levels, level, resolution))


def test_a_frame_does_not_depend_on_its_batch():
    levels = scene((GolfBall,), (GoalTile,), *[ANYTHING] * 3, n=1024)
    together = draw(levels)
    bound = Pixels().bind(levels, 1)
    alone = np.zeros((1, 64, 64, 3), np.uint8)
    for i in (0, 1, 500, 1023):
        bound.begin(levels.values[i : i + 1], np.array([i]), np.array([True]))
        bound.write(levels.values[i : i + 1], np.array([i]), alone, np.arange(0, 1))
        np.testing.assert_array_equal(alone[0], together[i])


def test_only_the_asked_range_is_written():
    levels = scene((GolfBall,), (GoalTile,), n=8)
    bound = Pixels().bind(levels, 8)
    bound.begin(levels.values, np.arange(8), np.ones(8, bool))
    frames = np.full((8, 64, 64, 3), 7, np.uint8)
    bound.write(levels.values, np.arange(8), frames, np.arange(2, 5))
    assert (frames[:2] == 7).all() and (frames[5:] == 7).all()
    np.testing.assert_array_equal(frames[2:5], draw(levels)[2:5])


def test_backgrounds_are_repainted_only_where_an_episode_begins():
    levels = scene((GolfBall,), (GoalTile,), n=2)
    first = draw(levels)
    bound = Pixels().bind(levels, 2)
    bound.begin(levels.values, np.array([0, 1]), np.ones(2, bool))
    put(levels, slice(None), 1, Position, 0.0)
    put(levels, slice(None), 1, Size, 0.6)
    bound.begin(levels.values, np.array([0, 1]), np.array([True, False]))
    frames = np.zeros((2, 64, 64, 3), np.uint8)
    bound.write(levels.values, np.array([0, 1]), frames, np.arange(0, 2))
    np.testing.assert_array_equal(frames[0], draw(levels)[0])
    np.testing.assert_array_equal(frames[1], first[1])


def test_among_objects_the_highest_order_lies_on_top_and_among_tiles_the_lowest():
    objects = scene((Ball,), (Bumper,), (Damper,))
    tiles = scene((SandTile,), (MagmaTile,), (Hole,))
    for entity, order in enumerate((1, 3, 2)):
        for levels in (objects, tiles):
            put(levels, 0, entity, Order, order)
            put(levels, 0, entity, Position, 0.0)
    for entity in range(3):
        put(objects, 0, entity, Size, 0.5)
        tiles.vertices[0, entity, :4], tiles.vertex_count[0, entity] = [[-1, -1], [1, -1], [1, 1], [-1, 1]], 4
    bumper, sand = COLOURS[Bumper], COLOURS[SandTile]
    assert tuple(draw(objects)[0, 32, 32]) == bumper.high
    friction = 0.4
    blend = np.rint(np.array(sand.low) + friction * (np.array(sand.high) - np.array(sand.low)))
    assert tuple(draw(tiles)[0, 32, 32]) == tuple(blend)


def test_objects_lie_on_tiles_whatever_their_order():
    levels = scene((GolfBall,), (GoalTile,))
    for entity, order in enumerate((-9, 9)):
        put(levels, 0, entity, Order, order)
        put(levels, 0, entity, Position, 0.0)
    assert tuple(draw(levels)[0, 32, 32]) == (255, 255, 255)


def test_what_is_invisible_or_absent_is_not_drawn():
    levels = scene((GolfBall,), (GoalTile,), (Ball,))
    put(levels, 0, 0, Visible, 0.0)
    put(levels, 0, 1, Visible, 0.0)
    levels.types[0, 2] = -1
    assert (draw(levels)[0] == FLOOR).all()


def test_an_object_is_drawn_as_large_and_as_visible_as_it_is_now():
    levels = scene((GolfBall,), (GoalTile,))
    put(levels, 0, 1, Visible, 0.0)
    put(levels, 0, 0, Position, 0.0)
    bound = Pixels().bind(levels, 1)
    bound.begin(levels.values, np.zeros(1, int), np.ones(1, bool))
    covered = []
    for size, visible in ((0.2, 1), (0.6, 1), (0.6, 0)):
        put(levels, 0, 0, Size, size)
        put(levels, 0, 0, Visible, visible)
        frames = np.zeros((1, 64, 64, 3), np.uint8)
        bound.write(levels.values, np.zeros(1, int), frames, np.arange(0, 1))
        covered.append((frames[0] != FLOOR).any(axis=-1).sum())
    # Radii are rounded to whole pixels (3 and 10); a disc of radius r covers about pi (r + 1/2)^2 of them.
    assert covered == [pytest.approx(np.pi * 3.5**2, rel=0.1), pytest.approx(np.pi * 10.5**2, rel=0.05), 0]


def test_only_mobile_objects_have_a_black_outline():
    levels = scene((Ball,), n=2)
    for level, mobile in enumerate((0, 1)):
        put(levels, level, 0, Position, 0.0)
        put(levels, level, 0, Size, 0.4)
        put(levels, level, 0, Mobile, mobile)
    frames = draw(levels)
    assert tuple(frames[0, 32, 32 - 6]) == COLOURS[Ball].low
    assert tuple(frames[1, 32, 32 - 6]) == (0, 0, 0)
    assert tuple(frames[1, 32, 32 - 5]) == COLOURS[Ball].low


def test_all_types_look_different_whatever_their_factors():
    blends = np.linspace(0, 1, 11)[:, None]
    shown = [np.array([FLOOR])]
    for entity, colour in COLOURS.items():
        if entity is not CueBall:  # it stands in for the golf ball
            shown.append(np.array(colour.low) + blends * (np.array(colour.high or colour.low) - np.array(colour.low)))
    for i, a in enumerate(shown):
        for b in shown[:i]:
            assert np.linalg.norm(a[:, None] - b, axis=-1).min() > 50


@pytest.mark.parametrize("entity", [Charger, Magnet])
def test_a_field_of_the_other_sign_looks_quite_different(entity):
    colour = COLOURS[entity]
    assert colour.factor in (Charge, Magnetism) and colour.span == (-1.0, 1.0)
    assert np.linalg.norm(np.array(colour.low) - np.array(colour.high)) > 200


def test_a_users_type_looks_like_its_nearest_ancestor_unless_it_has_a_colour():
    class Ember(SandTile): ...

    class Spark(Ember): ...

    assert colour_of(Spark) is COLOURS[SandTile]
    levels = scene((Spark,), hulls=False)
    put(levels, 0, 0, Position, 0.0)
    put(levels, 0, 0, Size, 0.4)
    assert tuple(draw(levels, Pixels(colours={Ember: Colour((1, 2, 3))}))[0, 32, 32]) == (1, 2, 3)


def test_pixels_keep_the_protocol_of_observations():
    levels = scene((GolfBall,), (GoalTile,))
    bound = Pixels().bind(levels, 1)
    assert isinstance(Pixels(), Observation)
    assert isinstance(bound, BoundObservation)
    assert bound.space.shape == (64, 64, 3) and bound.space.dtype == np.uint8


def test_wrong_resolutions_and_colours_are_refused():
    with pytest.raises(SegarError, match="multiple of 4 from 32 to 256, not 30"):
        Pixels(resolution=30)
    with pytest.raises(FactorError, match="whole numbers from 0 to 255"):
        Colour((0, 0, 256))
    with pytest.raises(FactorError, match="second colour"):
        Colour((0, 0, 0), (1, 1, 1))
    with pytest.raises(FactorError, match="Position has 2 columns"):
        Colour((0, 0, 0), (1, 1, 1), Position)
