"""Pixels against a plain numpy renderer, and the laws of what is drawn over what."""

import numpy as np
import pytest

from segar.errors import FactorError
from segar.language import Ball, CueBall, GoalTile, GolfBall, Position, SandTile, Size, Visible
from segar.observations.pixels.solid_colours import COLOURS, FLOOR, Colour, Pixels, colour_of
from tests.segar.observations.plain_renderer import Look, draw_plainly
from tests.segar.observations.scenes import ANYTHING, Scene, draw, put, scene


def solid(scene: Scene, level: int) -> Look:
    """Every thing in its colour."""

    def look(e: int, row: int, column: int) -> np.ndarray:
        colour = colour_of(scene.layout.types[scene.types[level, e]])
        rgb = np.array(colour.low, float)
        if colour.factor is not None:
            low, high = colour.span
            value = scene.values[level, e, scene.layout.columns[colour.factor]]
            rgb += np.clip((value - low) / (high - low), 0, 1) * (np.array(colour.high) - rgb)
        return np.rint(rgb)

    return look


@pytest.mark.parametrize("resolution", [32, 64, 100])
def test_frames_equal_those_of_a_plain_renderer(resolution):
    levels = scene((GolfBall,), (GoalTile,), *[ANYTHING] * 5, n=60, seed=resolution)
    frames = draw(levels, Pixels(resolution=resolution))
    for level in range(60):
        plain = draw_plainly(levels, level, solid(levels, level), np.full((resolution, resolution, 3), FLOOR, np.uint8))
        np.testing.assert_array_equal(frames[level], plain)


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


def test_all_types_look_different_whatever_their_factors():
    blends = np.linspace(0, 1, 11)[:, None]
    shown = [np.array([FLOOR])]
    for entity, colour in COLOURS.items():
        if entity is not CueBall:  # it stands in for the golf ball
            shown.append(np.array(colour.low) + blends * (np.array(colour.high or colour.low) - np.array(colour.low)))
    for i, a in enumerate(shown):
        for b in shown[:i]:
            assert np.linalg.norm(a[:, None] - b, axis=-1).min() > 50


def test_a_users_type_looks_like_its_nearest_ancestor_unless_it_has_a_colour():
    class Ember(SandTile): ...

    class Spark(Ember): ...

    assert colour_of(Spark) is COLOURS[SandTile]
    levels = scene((Spark,), hulls=False)
    put(levels, 0, 0, Position, 0.0)
    put(levels, 0, 0, Size, 0.4)
    assert tuple(draw(levels, Pixels(colours={Ember: Colour((1, 2, 3))}))[0, 32, 32]) == (1, 2, 3)


@pytest.mark.parametrize(
    ("colours", "message"),
    [
        (((0, 0, 256),), "whole numbers from 0 to 255"),
        (((0, 0, 0), (1, 1, 1)), "second colour"),
        (((0, 0, 0), (1, 1, 1), Position), "Position has 2 columns"),
    ],
)
def test_wrong_colours_are_refused(colours, message):
    with pytest.raises(FactorError, match=message):
        Colour(*colours)
