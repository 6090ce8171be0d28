"""Frames of environments that may overwrite what they returned: only what moved is drawn anew, and the rest is right."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

import segar
from segar import GolfBall, Pixels, Position, TexturedPixels
from segar.entities import GoalTile
from segar.envs import VectorEnv
from tests.observations.scenes import ANYTHING, frames_of, put, random_textures, scene, start

KINDS = {
    "solid": Pixels(),
    "grey": Pixels(grey=True),
    "channels first": Pixels(channels="first", resolution=100),
    "textured": TexturedPixels(random_textures(3)),
    "following": TexturedPixels("one", follow=True, channels="first"),
    "in parts": {"look": "textures", "state": "state"},
}
LEVELS = segar.family("objectsx3-hard").sample(12, seed=0)


@pytest.mark.parametrize("threads", [1, 2])
@pytest.mark.parametrize("kind", KINDS)
def test_frames_that_are_mended_are_those_that_are_drawn(kind, threads):
    envs = [
        VectorEnv(LEVELS, 70, observation=KINDS[kind], max_steps=11, num_threads=threads, copy=copy) for copy in (0, 1)
    ]
    rng = np.random.default_rng(0)

    def compare(*observed):
        mended, drawn = ([*one.values()] if isinstance(one, dict) else [one] for one in observed)
        for a, b in zip(mended, drawn, strict=True):
            np.testing.assert_array_equal(a, b)

    compare(*(env.reset(seed=3)[0] for env in envs))
    snapshots = [env.state() for env in envs]
    for step in range(40):
        actions = rng.uniform(-1, 1, (70, 2)).astype(np.float32)
        told = [env.step(actions) for env in envs]
        compare(*(one[0] for one in told))
        compare(*(one[4].get("final_obs", {}) for one in told))
        if step % 7 == 3:
            place, where = rng.uniform(-1, 1, 2), rng.random(70) < 0.3
            compare(*(env.intervene("golfball", Position, place, where) for env in envs))
        if step % 9 == 4:
            mask = rng.random(70) < 0.3
            compare(*(env.reset(options={"reset_mask": mask})[0] for env in envs))
        if step == 25:
            compare(*(env.restore(snapshot) for env, snapshot in zip(envs, snapshots, strict=True)))


@pytest.mark.parametrize("kind", ["solid", "grey", "channels first", "textured"])
def test_things_that_move_vanish_overlap_and_leave_the_frame_leave_no_trace(kind):
    levels = scene((GolfBall,), (GoalTile,), *[ANYTHING] * 4, n=64)
    bound, rng = start(levels, KINDS[kind], np.arange(64, dtype=np.uint64)), np.random.default_rng(1)
    everywhere = np.arange(64)
    for step in range(20):
        moved = dataclasses.replace(levels, values=levels.values.copy())
        for entity in (0, 2, 3, 4, 5):
            put(moved, slice(None), entity, Position, rng.uniform(-1.5, 1.5, 2))
        put(moved, slice(step, None, 7), 3, Position, np.nan)
        some = rng.permutation(64)[: rng.integers(1, 65)]  # the others stay as they were drawn
        before = bound.kept.copy()
        bound.write(moved.values, everywhere, bound.kept, some)
        expected = frames_of(start(levels, KINDS[kind], np.arange(64, dtype=np.uint64)), moved)
        np.testing.assert_array_equal(bound.kept[some], expected[some])
        rest = np.setdiff1d(everywhere, some)
        np.testing.assert_array_equal(bound.kept[rest], before[rest])


def test_drawing_elsewhere_between_two_steps_does_no_harm():
    levels = scene((GolfBall,), (GoalTile,), *[ANYTHING] * 4, n=16)
    bound, expected = (start(levels, Pixels(), np.arange(16, dtype=np.uint64)) for _ in range(2))
    moved = dataclasses.replace(levels, values=levels.values.copy())
    put(moved, slice(None), 0, Position, 0.3)
    bound.write(levels.values, np.arange(16), bound.kept, np.arange(16))
    frames_of(bound, moved)
    bound.write(levels.values, np.arange(16), bound.kept, np.arange(16))
    np.testing.assert_array_equal(bound.kept, frames_of(expected, levels))


def test_what_does_not_move_is_not_drawn_again():
    levels = scene((GolfBall,), (GoalTile,), n=4)
    bound = start(levels, Pixels(), np.arange(4, dtype=np.uint64))
    bound.write(levels.values, np.arange(4), bound.kept, np.arange(4))
    drawn = bound.kept.copy()
    bound.kept[:, 0, 0] ^= 255  # which nobody may do; in a corner, where no ball is
    bound.write(levels.values, np.arange(4), bound.kept, np.arange(4))
    assert (bound.kept != drawn).any(axis=(1, 2, 3)).all()
