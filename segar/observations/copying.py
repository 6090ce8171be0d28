"""Copying observations of any order in memory, and bytes within other kernels, by kernels that are faster than NumPy or than
loops; and how all kernels of observations are compiled."""

import sys
from typing import Any

import numpy as np
from numba.core import cgutils, types
from numba.extending import intrinsic

from segar.support import cached

# The kernels allocate nothing, so numba's counting of references to arrays, which costs as much as drawing, is off.
KERNEL_OPTIONS: dict[str, Any] = {"nogil": True, "error_model": "numpy", "_nrt": False}


def _copy_bytes(typing_context: Any, to: Any, to_byte: Any, source: Any, source_byte: Any, count: Any) -> Any:
    """``to[to_byte : to_byte + count] = source[source_byte : source_byte + count]``, counted in bytes from the starts of
    two contiguous uint8 arrays of any shape. Nothing is checked."""

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        there = _pointer(context, builder, signature.args[0], arguments[0], arguments[1])
        here = _pointer(context, builder, signature.args[2], arguments[2], arguments[3])
        cgutils.raw_memcpy(builder, there, here, arguments[4], 1)
        return context.get_dummy_value()

    return types.void(to, types.intp, source, types.intp, types.intp), generate


def _clear_bytes(typing_context: Any, to: Any, to_byte: Any, count: Any) -> Any:
    """``to[to_byte : to_byte + count] = 0``, counted as in :func:`_copy_bytes`."""

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        there = _pointer(context, builder, signature.args[0], arguments[0], arguments[1])
        cgutils.memset(builder, there, arguments[2], 0)
        return context.get_dummy_value()

    return types.void(to, types.intp, types.intp), generate


def _pointer(context: Any, builder: Any, kind: Any, array: Any, offset: Any) -> Any:
    """The address of a byte of an array."""
    return cgutils.pointer_add(builder, context.make_array(kind)(context, builder, array).data, offset)


copy_bytes: Any = intrinsic(_copy_bytes)
clear_bytes: Any = intrinsic(_clear_bytes)


BYTE, TWO_BYTES, THREE_BYTES = np.uint32(8), np.uint32(16), np.uint32(24)  # [bits]
WORDS = ((4, np.uint32), (2, np.uint16)) if sys.byteorder == "little" else ()  # the kernel puts the first byte lowest
BLOCK = 1024  # pixels that are joined together, in the processor's nearest cache


def copy_rows(source: np.ndarray, target: np.ndarray, rows: np.ndarray | None = None) -> None:
    """``target[rows] = source[rows]`` (all rows where it is None), for arrays of one shape and dtype.

    Pixels whose channels lie in planes, as in the stacks of environments with ``copy=False``, come to lie side by side in
    a contiguous ``target`` in half the time that numpy takes.
    """
    rows = np.arange(len(source)) if rows is None else rows
    if _lies_in_planes(source) and target.flags.c_contiguous:
        num_envs, height, width, depth = source.shape
        planes = source.transpose(0, 3, 1, 2).reshape(num_envs, depth, height * width)
        size, word = next(((size, word) for size, word in WORDS if depth % size == 0), (1, np.uint8))
        pixels = target.reshape(num_envs, height * width, depth).view(word)
        join(rows, planes, pixels, np.empty((depth // size, BLOCK), word))
    elif len(rows) and rows[-1] - rows[0] == len(rows) - 1 and (np.diff(rows) == 1).all():
        target[rows[0] : rows[-1] + 1] = source[rows[0] : rows[-1] + 1]  # a run in one piece
    else:
        target[rows] = source[rows]


def _lies_in_planes(array: np.ndarray) -> bool:
    """Whether these are frames, uint8 ``[env, height, width, depth]``, whose transposed rows are contiguous."""
    return (
        array.ndim == 4
        and array.dtype == np.uint8
        and array.shape[3] > 1
        and array[:1].transpose(0, 3, 1, 2).flags.c_contiguous
    )


@cached(**KERNEL_OPTIONS)
def join(rows, planes, pixels, packed):
    """Put the bytes of ``planes[rows]`` (uint8 ``[env, plane, pixel]``) side by side: ``pixels`` is uint8, uint16 or uint32
    ``[env, pixel, word]``, and a word holds the bytes of as many planes. ``packed`` is scratch, ``[word, BLOCK]``."""
    for r in range(len(rows)):
        for first in range(0, pixels.shape[1], packed.shape[1]):
            block = pixels[rows[r], first : first + packed.shape[1]]
            for w in range(len(packed)):
                pack(planes, rows[r], first, w, packed[w, : len(block)])
            interleave(packed, block)


@cached(**KERNEL_OPTIONS)
def pack(planes, env, first, w, words):
    """Fill ``words`` with word ``w`` of the pixels from ``first`` on, the byte of its first plane lowest."""
    size, last = words.itemsize, first + len(words)  # the compiler knows the size
    k = w * size
    a, b = planes[env, k, first:last], planes[env, k + (1 if size > 1 else 0), first:last]
    c, d = planes[env, k + (2 if size > 2 else 0), first:last], planes[env, k + (3 if size > 2 else 0), first:last]
    for p in range(len(words)):
        word = np.uint32(a[p])
        if size > 1:
            word |= np.uint32(b[p]) << BYTE
        if size > 2:
            word |= (np.uint32(c[p]) << TWO_BYTES) | (np.uint32(d[p]) << THREE_BYTES)
        words[p] = word


@cached(**KERNEL_OPTIONS)
def interleave(packed, block):
    """``block[p, w] = packed[w, p]``."""
    if len(packed) == 3:  # as of two or four RGB frames; a loop that names its arrays runs on wide registers
        first, second, third, words = packed[0], packed[1], packed[2], block.reshape(-1)
        for p in range(len(block)):
            words[3 * p] = first[p]
            words[3 * p + 1] = second[p]
            words[3 * p + 2] = third[p]
    else:
        for w in range(len(packed)):
            for p in range(len(block)):
                block[p, w] = packed[w, p]


def copy_squares(frames: np.ndarray, target: np.ndarray, side: int) -> None:
    """Each frame cut into squares, whose pixels come to lie side by side.

    A convolution whose kernel is a few strides wide is one of a few squares in that order, and much faster.

    Args:
        frames: uint8 ``[n, height, width, channels]``, in any order of memory.
        target: uint8 ``[n, height // side, width // side, side * side * channels]``, to be filled; its last axis is row,
            column, channel. Pixels beyond the last whole square are left out.
        side: of a square, in pixels.
    """
    if (side, frames.shape[3]) == (4, 3):
        split_rgb(frames, target)
    else:
        split(frames, target, side)


@cached(**KERNEL_OPTIONS)
def split_rgb(frames, target):
    """:func:`copy_squares` of RGB frames and squares of 4: three times as fast where the compiler knows the sizes."""
    for i in range(len(target)):
        for row in range(target.shape[1]):
            for dy in range(4):
                pixels = frames[i, 4 * row + dy]
                for column in range(target.shape[2]):
                    square = target[i, row, column]
                    for dx in range(4):
                        for c in range(3):
                            square[12 * dy + 3 * dx + c] = pixels[4 * column + dx, c]


@cached(**KERNEL_OPTIONS)
def split(frames, target, side):
    """:func:`copy_squares` of any sizes."""
    channels = frames.shape[3]
    for i in range(len(target)):
        for y in range(side * target.shape[1]):
            for x in range(side * target.shape[2]):
                square = target[i, y // side, x // side]
                first = (y % side * side + x % side) * channels
                for c in range(channels):
                    square[first + c] = frames[i, y, x, c]
