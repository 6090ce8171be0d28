"""Grey frames, channels first, other walls, other sizes: one drawing in many forms."""

import dataclasses

import numpy as np
import pytest

from segar import GoalTile, GolfBall, Position, SegarError, World
from segar.observations import Pixels, TexturedPixels
from segar.observations.pixels.drawing import grey_of
from tests.segar.observations.plain_renderer import draw_plainly
from tests.segar.observations.scenes import ANYTHING, draw, frames_of, put, random_textures, scene, start
from tests.segar.observations.test_pixels import solid

LEVELS = scene((GolfBall,), (GoalTile,), *[ANYTHING] * 5, n=48)
KINDS = {
    "solid": Pixels(),
    "textured": TexturedPixels(random_textures(3)),
    "wide": TexturedPixels(random_textures(1, 7)),
}


@pytest.mark.parametrize("resolution", [32, 64, 100, 256])
@pytest.mark.parametrize("kind", KINDS)
def test_channels_first_and_grey_show_the_same_picture(kind, resolution):
    coloured = dataclasses.replace(KINDS[kind], resolution=resolution)
    frames = draw(LEVELS, coloured)
    assert frames.shape == (48, resolution, resolution, 3)
    first = draw(LEVELS, dataclasses.replace(coloured, channels="first"))
    np.testing.assert_array_equal(first, frames.transpose(0, 3, 1, 2))
    grey = draw(LEVELS, dataclasses.replace(coloured, grey=True))
    np.testing.assert_array_equal(grey, grey_of(frames)[..., None])
    grey_first = draw(LEVELS, dataclasses.replace(coloured, grey=True, channels="first"))
    np.testing.assert_array_equal(grey_first, grey_of(frames)[:, None])


def test_grey_is_the_rounded_luma():
    colours = np.random.default_rng(0).integers(0, 256, (1000, 3))
    np.testing.assert_array_equal(grey_of(colours), np.round(colours @ [0.299, 0.587, 0.114] + 1e-9))


@pytest.mark.parametrize("walls", [0.5, 3.0])
def test_a_frame_shows_the_world_from_wall_to_wall(walls):
    levels = dataclasses.replace(LEVELS, world=World(walls=walls))
    frames = draw(levels, Pixels())
    floor = draw(scene((GolfBall,), hulls=False), Pixels())[0, :1, :1]
    for level in range(48):
        plain = draw_plainly(levels, level, solid(levels, level), np.tile(floor, (64, 64, 1)), walls)
        np.testing.assert_array_equal(frames[level], plain)


@pytest.mark.parametrize("kind", KINDS)
def test_a_frame_does_not_depend_on_its_batch_nor_on_the_order_of_drawing(kind):
    levels = scene((GolfBall,), (GoalTile,), *[ANYTHING] * 3, n=256)
    pixels, keys = KINDS[kind], np.arange(256, dtype=np.uint64)
    together = draw(levels, pixels, keys)
    parts = start(levels, pixels, keys)
    frames = np.zeros_like(together)
    for rows in np.array_split(np.random.default_rng(0).permutation(256), 7):
        parts.write(levels.values, np.arange(256), frames, rows)
    np.testing.assert_array_equal(frames, together)
    alone, one = pixels.bind(levels, 1), np.zeros((1, 64, 64, 3), np.uint8)
    for i in (0, 1, 100, 255):
        if hasattr(alone, "start"):
            alone.start(keys[i : i + 1], np.array([i]), np.array([True]))
        alone.begin(levels.values[i : i + 1], np.array([i]), np.array([True]))
        alone.write(levels.values[i : i + 1], np.array([i]), one, np.arange(1))
        np.testing.assert_array_equal(one[0], together[i])


@pytest.mark.parametrize("kind", KINDS)
def test_what_was_drawn_before_leaves_no_trace(kind):
    levels = scene((GolfBall,), (GoalTile,), *[ANYTHING] * 3, n=32)
    bound = start(levels, KINDS[kind], np.arange(32, dtype=np.uint64))
    before = frames_of(bound, levels)
    moved = dataclasses.replace(levels, values=levels.values.copy())
    put(moved, slice(None), 0, Position, 0.3)
    assert not np.array_equal(frames_of(bound, moved), before)
    np.testing.assert_array_equal(frames_of(bound, levels), before)


@pytest.mark.parametrize("kind", [Pixels, TexturedPixels])
def test_forms_that_do_not_exist_are_refused_with_what_does(kind):
    options = {"textures": random_textures()} if kind is TexturedPixels else {}
    for resolution in (30, 28, 260):
        with pytest.raises(SegarError, match=f"{kind.__name__}: .*multiple of 4 from 32 to 256, not {resolution}"):
            kind(resolution=resolution, **options)
    with pytest.raises(SegarError, match=f"{kind.__name__}: channels .*not 'frist'. Did you mean 'first'?"):
        kind(channels="frist", **options)


def test_frames_are_drawn_into_memory_with_gaps_between_them_but_not_within_them():
    bound, gaps = start(LEVELS, Pixels(), np.zeros(48, np.uint64)), np.zeros((48, 2, 64, 64, 3), np.uint8)
    bound.write(LEVELS.values, np.arange(48), gaps[:, 1], np.arange(48))
    np.testing.assert_array_equal(gaps[:, 1], frames_of(bound, LEVELS))
    assert not gaps[:, 0].any()
    with pytest.raises(SegarError, match="contiguous memory only"):
        bound.write(LEVELS.values, np.arange(48), np.moveaxis(gaps[:, 0], 1, 2), np.arange(48))
