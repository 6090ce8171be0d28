"""Code that is fast by a trick gives the same bits as its plain twin, to which SEGAR_PLAIN=1 switches."""

from __future__ import annotations

import hashlib
import os
import subprocess
import sys

import numpy as np
import pytest
from numba import njit

import segar
from segar.envs import VectorEnv
from segar.observations import copying, leaves
from segar.observations.composed.stack import FrameTape, PlainFrameTape
from segar.observations.copying import KERNEL_OPTIONS, clear_bytes, copy_bytes, plain_clear_bytes, plain_copy_bytes


@njit(**{**KERNEL_OPTIONS, "cache": False})
def copy_and_clear(target, source, spans):
    for k in range(len(spans)):
        copy_bytes(target, spans[k, 0], source, spans[k, 1], spans[k, 2])
        clear_bytes(target, spans[k, 3], spans[k, 4])


@njit(**{**KERNEL_OPTIONS, "cache": False})
def copy_and_clear_plainly(target, source, spans):
    for k in range(len(spans)):
        plain_copy_bytes(target, spans[k, 0], source, spans[k, 1], spans[k, 2])
        plain_clear_bytes(target, spans[k, 3], spans[k, 4])


def test_bytes_are_copied_and_cleared_as_loops_do_it():
    rng = np.random.default_rng(0)
    source, spans = rng.integers(0, 256, (7, 5, 40), dtype=np.uint8), rng.integers(0, 40, (300, 5))
    spans[:, [0, 1, 3]] *= 30
    clever, plain = np.full((4, 350), 9, np.uint8), np.full((4, 350), 9, np.uint8)
    copy_and_clear(clever, source, spans)
    copy_and_clear_plainly(plain, source, spans)
    np.testing.assert_array_equal(clever, plain)
    assert len(np.unique(clever)) > 100


@pytest.mark.parametrize("depth", [2, 3, 6, 8])
def test_planes_are_copied_as_numpy_does_it(depth, monkeypatch):
    frames = np.random.default_rng(depth).integers(0, 256, (5, depth, 12, 16), dtype=np.uint8).transpose(0, 2, 3, 1)
    clever, plain = np.zeros(frames.shape, np.uint8), np.zeros(frames.shape, np.uint8)
    copying.copy_rows(frames, clever, np.array([3, 0, 4]))
    monkeypatch.setattr(copying, "is_plain", lambda: True)
    copying.copy_rows(frames, plain, np.array([3, 0, 4]))
    np.testing.assert_array_equal(clever, plain)


@pytest.mark.parametrize(("shape", "side"), [((3, 64, 64, 3), 4), ((2, 9, 13, 2), 4), ((2, 12, 9, 3), 3)])
def test_squares_are_cut_as_numpy_does_it(shape, side, monkeypatch):
    frames = np.random.default_rng(0).integers(0, 256, shape, dtype=np.uint8)
    size = (shape[0], shape[1] // side, shape[2] // side, side * side * shape[3])
    clever, plain = np.zeros(size, np.uint8), np.zeros(size, np.uint8)
    copying.copy_squares(frames, clever, side)
    monkeypatch.setattr(copying, "is_plain", lambda: True)
    copying.copy_squares(frames, plain, side)
    np.testing.assert_array_equal(clever, plain)


def test_a_tape_holds_the_frames_that_moved_frames_hold(monkeypatch):
    monkeypatch.setattr("segar.observations.composed.stack.TAPE", 5)
    rng, frame = np.random.default_rng(0), (2, 3)
    tape, plain = (kind(4, 3, frame, np.dtype(np.float32)) for kind in (FrameTape, PlainFrameTape))
    for _ in range(40):
        newest = rng.normal(size=(4, *frame))
        for one in (tape, plain):
            one.advance()
            one.stacks[:, -1] = newest
        np.testing.assert_array_equal(tape.stacks, plain.stacks)


def rollout_hash() -> str:
    """A hash of the observations of some steps, of everything that has a plain twin."""
    levels, found = segar.family("objectsx2-hard").sample(6, seed=0), hashlib.sha256()
    for observation, copy in (("rgb_stack4", True), (("rgb_stack2", "state"), False)):
        env = VectorEnv(levels, 5, observation=observation, seed=0, copy=copy, max_steps=20)
        seen = [env.reset()[0]]
        for k in range(70):
            seen.append(env.step(np.random.default_rng(k).uniform(-1, 1, (5, 2)).astype(np.float32))[0])
            for array in leaves(seen.pop()):
                found.update(np.ascontiguousarray(array).tobytes())
    return found.hexdigest()


@pytest.mark.slow
def test_environments_give_the_same_bits_with_plain_twins():
    code = "from tests.segar.observations.test_plain_copies import rollout_hash; print(rollout_hash())"
    environment = {**os.environ, "SEGAR_PLAIN": "1"}
    plain = subprocess.run([sys.executable, "-c", code], env=environment, capture_output=True, text=True, check=True)
    assert plain.stdout.split()[-1] == rollout_hash()
