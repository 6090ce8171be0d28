"""What is copied by a kernel is what NumPy copies."""

import numpy as np
import pytest
from numba import njit

from segar.observations import copying
from segar.observations.copying import KERNEL_OPTIONS, clear_bytes, copy_bytes


@njit(**KERNEL_OPTIONS)
def copy_and_clear(target, source, spans):
    for k in range(len(spans)):
        copy_bytes(target, spans[k, 0], source, spans[k, 1], spans[k, 2])
        clear_bytes(target, spans[k, 3], spans[k, 4])


def test_bytes_are_copied_and_cleared_as_numpy_does_it():
    rng = np.random.default_rng(0)
    source, spans = rng.integers(0, 256, (7, 5, 40), dtype=np.uint8), rng.integers(0, 40, (300, 5))
    spans[:, [0, 1, 3]] *= 30
    copied, expected = np.full((4, 350), 9, np.uint8), np.full(4 * 350, 9, np.uint8)
    copy_and_clear(copied, source, spans)
    for to, first, count, cleared, length in spans:
        expected[to : to + count] = source.ravel()[first : first + count]
        expected[cleared : cleared + length] = 0
    np.testing.assert_array_equal(copied.ravel(), expected)
    assert len(np.unique(copied)) > 100


@pytest.mark.parametrize("depth", [2, 3, 6, 8])
def test_planes_are_copied_as_numpy_does_it(depth):
    frames = np.random.default_rng(depth).integers(0, 256, (5, depth, 12, 16), dtype=np.uint8).transpose(0, 2, 3, 1)
    copied, expected, rows = np.zeros(frames.shape, np.uint8), np.zeros(frames.shape, np.uint8), np.array([3, 0, 4])
    copying.copy_rows(frames, copied, rows)
    expected[rows] = frames[rows]
    np.testing.assert_array_equal(copied, expected)


@pytest.mark.parametrize(("shape", "side"), [((3, 64, 64, 3), 4), ((2, 9, 13, 2), 4), ((2, 12, 9, 3), 3)])
def test_squares_are_cut_as_numpy_does_it(shape, side):
    frames = np.random.default_rng(0).integers(0, 256, shape, dtype=np.uint8)
    n, rows, columns = shape[0], shape[1] // side, shape[2] // side
    copied = np.zeros((n, rows, columns, side * side * shape[3]), np.uint8)
    copying.copy_squares(frames, copied, side)
    squares = frames[:, : side * rows, : side * columns].reshape(n, rows, side, columns, side, -1)
    np.testing.assert_array_equal(copied, squares.transpose(0, 1, 3, 2, 4, 5).reshape(copied.shape))
