"""Observations of any order of memory are copied whole, and nothing else is touched."""

from __future__ import annotations

import numpy as np
import pytest

from segar.observations.copying import copy_rows, copy_squares

ENVS = 12
SETS = {"all": None, "a run": np.arange(3, 9), "any": np.array([7, 0, 3]), "mixed ends": np.array([2, 9, 4, 5]),
        "none": np.arange(0)}  # fmt: skip


def in_planes(frames: np.ndarray) -> np.ndarray:
    """Equal frames whose channels lie in planes."""
    return np.ascontiguousarray(frames.transpose(0, 3, 1, 2)).transpose(0, 2, 3, 1)


@pytest.mark.parametrize("depth", [1, 2, 3, 4, 6, 8, 9, 12, 16])
@pytest.mark.parametrize("rows", SETS.values(), ids=SETS)
@pytest.mark.parametrize(("from_planes", "to_planes"), [(True, False), (False, True), (True, True), (False, False)])
def test_frames_are_copied_between_all_orders_of_memory(depth, rows, from_planes, to_planes):
    frames = np.random.default_rng(depth).integers(0, 256, (ENVS, 36, 40, depth), dtype=np.uint8)
    target = np.full_like(frames, 7)
    expected = target.copy()
    chosen = slice(None) if rows is None else rows
    expected[chosen] = frames[chosen]
    target = in_planes(target) if to_planes else target
    copy_rows(in_planes(frames) if from_planes else frames, target, rows)
    np.testing.assert_array_equal(target, expected)


def test_frames_in_planes_with_gaps_between_them_are_copied():
    tape = np.random.default_rng(0).integers(0, 256, (ENVS, 7, 8, 8), dtype=np.uint8)
    window = tape[:, 2:6].transpose(0, 2, 3, 1)
    target = np.zeros(window.shape, np.uint8)
    copy_rows(window, target)
    np.testing.assert_array_equal(target, window)


def test_what_is_no_frame_is_copied():
    numbers, target = np.random.default_rng(0).normal(size=(ENVS, 5)), np.zeros((ENVS, 5))
    copy_rows(numbers, target, np.array([1, 4]))
    np.testing.assert_array_equal(target[[1, 4]], numbers[[1, 4]])
    assert not np.delete(target, [1, 4], 0).any()


@pytest.mark.parametrize(("shape", "side"), [((3, 64, 64, 3), 4), ((2, 9, 13, 2), 4), ((2, 12, 9, 3), 3)])
@pytest.mark.parametrize("planes", [False, True])
def test_squares_hold_the_pixels_of_their_place(shape, side, planes):
    frames = np.random.default_rng(0).integers(0, 256, shape, dtype=np.uint8)
    n, height, width, channels = shape
    target = np.zeros((n, height // side, width // side, side * side * channels), np.uint8)
    copy_squares(in_planes(frames) if planes else frames, target, side)
    for i, row, column in np.ndindex(target.shape[:-1]):
        square = frames[i, row * side : (row + 1) * side, column * side : (column + 1) * side]
        np.testing.assert_array_equal(target[i, row, column], square.ravel())
