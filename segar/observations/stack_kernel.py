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
ONE_BYTE, THREE_BYTES, TWO_BYTES = np.uint32(0xFF), np.uint32(0xFFFFFF), np.uint32(16)
COLOUR_BITS, TWO_COLOURS_BITS = np.uint64(24), np.uint64(48)


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
def push_pixels(rows, frames, fresh, pending, age, todo, four_rgb):
    """Like :func:`push` for frames whose pixels lie side by side.

    ``age[env, u]`` is the number of steps for which a unit still has to be moved, until all its frames are the newest;
    ``todo`` is scratch, ``[u]``.
    """
    n = frames.bytes.shape[3]
    for r in range(len(rows)):
        env = rows[r]
        moves = pending[env]
        if fresh[env]:
            for u in range(age.shape[1]):
                if four_rgb:
                    fill_four_rgb(frames, env, u)
                else:
                    fill_unit(frames, env, u)
                age[env, u] = 0
        else:
            for k in range(find_restless(frames.drawn_words, frames.newest_words, env, age, n, todo)):
                if moves and four_rgb:
                    move_four_rgb(frames, env, todo[k])
                else:
                    move_unit(frames, env, todo[k], moves)
                if moves:
                    age[env, todo[k]] -= 1
        fresh[env] = False
        pending[env] = False


@njit(**_options)
def find_restless(drawn, newest, env, age, n, todo):
    """List in ``todo`` the units that changed now or in the last ``n - 1`` steps; return how many."""
    count = 0
    for u in range(age.shape[1]):
        changed = np.uint64(0)
        for w in range(newest.shape[2]):
            changed |= drawn[env, u, w] ^ newest[env, u, w]
        if changed != 0:
            age[env, u] = n
        if age[env, u] > 0:
            todo[count] = u
            count += 1
    return count


@njit(**_options)
def fill_unit(frames, env, u):
    """Make all frames of a unit the drawn one."""
    drawn, stack = frames.drawn_bytes, frames.bytes
    note_newest(frames.drawn_words, frames.newest_words, env, u)
    for p in range(PIXELS):
        for k in range(stack.shape[3]):
            for c in range(stack.shape[4]):
                stack[env, u, p, k, c] = drawn[env, u, p, c]


@njit(**_options)
def fill_four_rgb(frames, env, u):
    """Like :func:`fill_unit` for pixels of twelve bytes, as 8 and 4 of them."""
    note_newest(frames.drawn_words, frames.newest_words, env, u)
    for p in range(PIXELS):
        colours = frames.colours[env, u, p]
        once = np.uint64(colours & THREE_BYTES)
        frames.heads[env, u, p] = once | (once << COLOUR_BITS) | (once << TWO_COLOURS_BITS)
        frames.tails[env, u, p] = ((colours >> TWO_BYTES) & ONE_BYTE) | (colours << BYTE_BITS)


@njit(**_options)
def move_unit(frames, env, u, pending):
    """Move the frames of a unit by one place, if one is pending, and put in the drawn one."""
    drawn, stack = frames.drawn_bytes, frames.bytes
    note_newest(frames.drawn_words, frames.newest_words, env, u)
    if pending:
        words, following = frames.words, frames.next_words
        for w in range(words.shape[2]):
            words[env, u, w] = following[env, u, w]
    for p in range(PIXELS):
        for c in range(stack.shape[4]):
            stack[env, u, p, stack.shape[3] - 1, c] = drawn[env, u, p, c]


@njit(**_options)
def move_four_rgb(frames, env, u):
    """Like :func:`move_unit` for pixels of twelve bytes, as 8 and 4 of them."""
    heads, next_heads, tails, colours = frames.heads, frames.next_heads, frames.tails, frames.colours
    note_newest(frames.drawn_words, frames.newest_words, env, u)
    for p in range(PIXELS):
        heads[env, u, p] = next_heads[env, u, p]
        tails[env, u, p] = (tails[env, u, p] >> LAST_BYTE) | (colours[env, u, p] << BYTE_BITS)


@njit(**_options)
def note_newest(drawn, newest, env, u):
    """Remember what the newest frame of the stack is in this unit."""
    for w in range(newest.shape[2]):
        newest[env, u, w] = drawn[env, u, w]


@njit(**_options)
def push_planes(rows, drawn, newest, words, fresh, pending, age, todo):
    """Like :func:`push_pixels` for frames that lie one after the other: ``words[env, frame, u, w]``."""
    n = words.shape[1]
    for r in range(len(rows)):
        env = rows[r]
        if fresh[env]:
            for u in range(age.shape[1]):
                note_newest(drawn, newest, env, u)
                for k in range(n):
                    for w in range(words.shape[3]):
                        words[env, k, u, w] = drawn[env, u, w]
                age[env, u] = 0
        else:
            for i in range(find_restless(drawn, newest, env, age, n, todo)):
                u = todo[i]
                note_newest(drawn, newest, env, u)
                if pending[env]:
                    for k in range(n - 1):
                        for w in range(words.shape[3]):
                            words[env, k, u, w] = words[env, k + 1, u, w]
                    age[env, u] -= 1
                for w in range(words.shape[3]):
                    words[env, n - 1, u, w] = drawn[env, u, w]
        fresh[env] = False
        pending[env] = False
