"""Frames that are drawn row by row, as GPUs draw them, have the bytes of frames that are drawn whole."""

import numpy as np
import pytest

from segar.language.entities import GoalTile, GolfBall
from segar.observations import Pixels, TexturedPixels
from segar.observations.pixels.drawing import draw_rows, paint_rows
from tests.segar.observations.scenes import ANYTHING, random_textures, scene

KINDS = {
    "solid": Pixels(),
    "solid, 128, grey, channels first": Pixels(128, grey=True, channels="first"),
    "solid, channels first": Pixels(96, channels="first"),
    "textures": TexturedPixels(random_textures(3, 5)),
}


@pytest.mark.parametrize("kind", KINDS)
def test_rows_have_the_bytes_of_whole_frames(kind):
    levels = scene((GolfBall,), (GoalTile,), *[ANYTHING] * 5, n=60, seed=3)
    count, entities = levels.types.shape
    bound = KINDS[kind].bind(levels, count)  # type: ignore[arg-type]
    level, everywhere = np.arange(count), np.ones(count, bool)
    values = levels.values
    if hasattr(bound, "start"):
        bound.start(np.arange(count, dtype=np.uint64), level, everywhere)
    bound.begin(values, level, everywhere)
    frames = np.empty((count, *bound.space.shape), np.uint8)
    bound.write(values, level, frames, np.arange(count))

    drawing = bound._drawing
    geometry, canvas = drawing._geometry, drawing._canvas
    painted, chosen = drawing._backgrounds.copy(), np.empty(entities, np.int64)
    drawing._backgrounds[:] = 7
    rows = np.random.default_rng(0).permutation(count * canvas.resolution)  # each by itself, in any order
    columns, how = np.asfortranarray(values), (geometry, canvas, drawing.texels)
    paint_rows(columns, level, rows, *how, drawing.floor, drawing._floors, drawing._backgrounds, chosen)
    assert np.array_equal(painted, drawing._backgrounds)
    found = np.full(frames.size, 7, np.uint8)
    draw_rows(columns, level, rows, *how, drawing._backgrounds, found, frames[0].size, chosen)
    assert np.array_equal(frames.reshape(-1), found) and len(np.unique(frames)) > 5
