"""The compiled kernels of frame stacks: the stack itself is the ring buffer, and what did not change is not moved.

A stack of n frames is kept as it is shown. When a step is taken, every frame moves by one place towards the oldest, which
is most of the memory that an environment touches. But most of a frame is background: a unit of it (eight pixels) that
was the same in the last n frames stays as it is, so that a step costs a comparison of two frames, and the moving of what
changed.
"""

from __future__ import annotations

import sys
from typing import NamedTuple

import numpy as np
from numba import njit

_options = {"nogil": True, "cache": True, "error_model": "numpy", "_nrt": False}

PIXELS = 8  # of a unit: so that it is whole 64-bit words, whatever the channels
BYTE_BITS = np.uint32(8)
LAST_BYTE = np.uint32(24)


class Frames(NamedTuple):
    """Views of the memory of frames that the kernel walks; ``u`` is the unit, ``w`` a 64-bit word, ``p`` a pixel.

    Attributes:
        drawn_words, newest_words: ``[env, u, w]``, the frame that was drawn now, and the newest one in the stack.
        drawn_bytes: ``[env, u, p, channel]``.
        words: of the stack, ``[env, u, w]`` where a pixel's frames lie side by side, else ``[env, frame, u, w]``.
        next_words: like ``words``, one frame further on.
        bytes: of the stack, ``[env, u, p, frame, channel]``.
        fours: ``heads``, ``next_heads``, ``tails`` and ``colours``, ``[env, u, p]``: of a pixel of four RGB frames the
            first 8 bytes, the 8 bytes that shall stand there, the last 4 bytes, and the drawn ones with a spare byte.
    """

    drawn_words: np.ndarray
    newest_words: np.ndarray
    drawn_bytes: np.ndarray
    words: np.ndarray
    next_words: np.ndarray
    bytes: np.ndarray
    heads: np.ndarray
    next_heads: np.ndarray
    tails: np.ndarray
    colours: np.ndarray


def is_of_four_rgb(n: int, channels: int) -> bool:
    """Whether a pixel of the stack is twelve bytes that three wide moves can shift."""
    return n == 4 and channels == 3 and sys.byteorder == "little"


@njit(**_options)
def push(rows, drawn, stack, fresh, pending):
    """Put ``drawn[rows]`` (``[env, outer, inner]``) into ``stack`` (``[env, outer, frame, inner]``): the newest is last.

    Where ``fresh``, all frames become it; where ``pending``, the others move on; else it replaces the newest.
    """
    outer, n, inner = stack.shape[1], stack.shape[2], stack.shape[3]
    for r in range(len(rows)):
        env = rows[r]
        for o in range(outer):
            if fresh[env] or pending[env]:
                for k in range(n - 1):
                    for i in range(inner):
                        stack[env, o, k, i] = drawn[env, o, i] if fresh[env] else stack[env, o, k + 1, i]
            for i in range(inner):
                stack[env, o, n - 1, i] = drawn[env, o, i]
        fresh[env] = False
        pending[env] = False


@njit(**_options)
def push_pixels(rows, frames, fresh, pending, age, four_rgb):
    """Like :func:`push` for frames whose pixels lie side by side; ``age[env, u]`` counts down until a unit is at rest."""
    units, words = frames.newest_words.shape[1], frames.newest_words.shape[2]
    n, channels = frames.bytes.shape[3], frames.bytes.shape[4]
    for r in range(len(rows)):
        env = rows[r]
        for u in range(units):
            changed = np.uint64(0)
            for w in range(words):
                changed |= frames.drawn_words[env, u, w] ^ frames.newest_words[env, u, w]
            if fresh[env]:
                for p in range(PIXELS):
                    for k in range(n):
                        for c in range(channels):
                            frames.bytes[env, u, p, k, c] = frames.drawn_bytes[env, u, p, c]
            if changed != 0:
                for w in range(words):
                    frames.newest_words[env, u, w] = frames.drawn_words[env, u, w]
                age[env, u] = n
            if fresh[env]:
                age[env, u] = 0
            if age[env, u] == 0:
                continue
            if pending[env] and four_rgb:
                for p in range(PIXELS):
                    frames.heads[env, u, p] = frames.next_heads[env, u, p]
                    oldest = frames.tails[env, u, p] >> LAST_BYTE
                    frames.tails[env, u, p] = oldest | (frames.colours[env, u, p] << BYTE_BITS)
            else:
                if pending[env]:
                    for w in range(frames.words.shape[2]):
                        frames.words[env, u, w] = frames.next_words[env, u, w]
                for p in range(PIXELS):
                    for c in range(channels):
                        frames.bytes[env, u, p, n - 1, c] = frames.drawn_bytes[env, u, p, c]
            if pending[env]:
                age[env, u] -= 1
        fresh[env] = False
        pending[env] = False


@njit(**_options)
def push_planes(rows, drawn_words, newest_words, words, fresh, pending, age):
    """Like :func:`push_pixels` for frames that lie one after the other: ``words[env, frame, u, w]``."""
    n, units, width = words.shape[1], words.shape[2], words.shape[3]
    for r in range(len(rows)):
        env = rows[r]
        for u in range(units):
            changed = np.uint64(0)
            for w in range(width):
                changed |= drawn_words[env, u, w] ^ newest_words[env, u, w]
            if changed != 0:
                age[env, u] = n
                for w in range(width):
                    newest_words[env, u, w] = drawn_words[env, u, w]
            if fresh[env]:
                age[env, u] = 0
                for k in range(n - 1):
                    for w in range(width):
                        words[env, k, u, w] = drawn_words[env, u, w]
            elif age[env, u] == 0:
                continue
            elif pending[env]:
                age[env, u] -= 1
                for k in range(n - 1):
                    for w in range(width):
                        words[env, k, u, w] = words[env, k + 1, u, w]
            for w in range(width):
                words[env, n - 1, u, w] = drawn_words[env, u, w]
        fresh[env] = False
        pending[env] = False
