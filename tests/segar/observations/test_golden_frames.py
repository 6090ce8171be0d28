"""Frames of a fixed seed: equal on repeat, however they are batched, and equal to those of the same renderer version."""

import hashlib

import numpy as np
import pytest

from segar.language.entities import GoalTile, GolfBall
from segar.observations import Pixels, TexturedPixels
from segar.observations.pixels.drawing import RENDERER_VERSION
from tests.segar.observations.scenes import ANYTHING, draw, random_textures, scene

KINDS = {
    "solid": Pixels(),
    "solid, 128, grey, channels first": Pixels(128, grey=True, channels="first"),
    "textures": TexturedPixels(random_textures(3, 5)),
    "textures, one": TexturedPixels("one"),
}
pytestmark = pytest.mark.processor  # each machine draws the same frames
GOLDEN_VERSION = 2
GOLDEN = {
    "solid": "eeb56030bee0a1db",
    "solid, 128, grey, channels first": "00593a0e12acc658",
    "textures": "f745c086ee89b397",
    "textures, one": "4d2b658224b9af88",
}


@pytest.mark.parametrize("kind", KINDS)
def test_a_hundred_frames_are_those_of_this_renderer_version(kind):
    levels = scene((GolfBall,), (GoalTile,), *[ANYTHING] * 4, n=100, seed=2026)
    frames = draw(levels, KINDS[kind], np.arange(100, dtype=np.uint64))
    found = hashlib.sha256(frames.tobytes()).hexdigest()[:16]
    assert (RENDERER_VERSION, found) == (GOLDEN_VERSION, GOLDEN[kind]), (
        "Frames are no longer what they were. If that is not meant, mend it. If it is: raise RENDERER_VERSION in"
        " segar/observations/pixels/drawing.py and GOLDEN_VERSION here, put the new hashes here, and say in CHANGELOG.md under"
        f" 'Changes results' what looks different and since which version. '{kind}' is now {found}."
    )
