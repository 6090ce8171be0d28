"""Textured frames of ``objectsx3-hard`` drawn by hand: the yardstick of the pixel kernel.

Nothing here comes from the renderer but its table of circles. What a person knows about this world is used: four discs, all
visible and outlined, on a background that is there already; 64 x 64 pixels of three bytes; patterns of 3 x 3 pixels.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numba import njit

from segar.language.factors import Mass, Order, Position, Size
from segar.levels.level_set import Levels
from segar.observations.pixels.drawing import disc_spans

SIDE = 64
BODIES = 4


@dataclass
class Album:
    """What is drawn: ``background[env, 12288 bytes]``, ``patches[env, body, 3, 3, 3]``, and where a state holds bodies."""

    backgrounds: np.ndarray
    patches: np.ndarray
    slots: np.ndarray
    columns: np.ndarray
    spans: np.ndarray

    @classmethod
    def of(cls, levels: Levels, backgrounds: np.ndarray, patches: np.ndarray) -> Album:
        """An album over states of ``levels``; backgrounds uint8 ``[env, 64, 64, 3]``."""
        words = np.ascontiguousarray(backgrounds.reshape(len(backgrounds), -1)).view(np.uint64)
        return cls(words, patches, bodies(levels), columns(levels), disc_spans(SIDE))

    def draw(self, values: np.ndarray, frames: np.ndarray) -> None:
        """Fill ``frames``, uint8 ``[env, 64, 64, 3]``, from states float64 ``[env, entity, column]``."""
        draw(values, self.backgrounds, self.patches, self.slots, self.columns, self.spans,
             frames.reshape(len(frames), -1).view(np.uint64), frames, np.empty(BODIES, np.int64))  # fmt: skip


def bodies(levels: Levels) -> np.ndarray:
    """Slots of what moves."""
    return np.array([k for k, slot in enumerate(levels.layout.slots) if slot.must_have(Mass)])


def columns(levels: Levels) -> np.ndarray:
    """First columns of Position, Size and Order."""
    return np.array([levels.layout.columns[factor] for factor in (Position, Size, Order)])


@njit(nogil=True, cache=True, error_model="numpy", _nrt=False)
def draw(values, backgrounds, patches, slots, columns, spans, words, frames, order):
    for env in range(len(frames)):
        for k in range(words.shape[1]):
            words[env, k] = backgrounds[env, k]
        for body in range(BODIES):
            k = body
            while k > 0 and values[env, slots[order[k - 1]], columns[2]] > values[env, slots[body], columns[2]]:
                order[k] = order[k - 1]
                k -= 1
            order[k] = body
        for k in range(BODIES):
            body = order[k]
            slot = slots[body]
            cx = int(np.rint((values[env, slot, columns[0]] + 1.0) * 32.0))
            cy = SIDE - int(np.rint((values[env, slot, columns[0] + 1] + 1.0) * 32.0))
            r = int(np.rint(values[env, slot, columns[1]] * 16.0))
            for row in range(max(cy - r, 0), min(cy + r, SIDE - 1) + 1):
                outer, inner = spans[r, abs(row - cy), 0], spans[r, abs(row - cy), 1]
                down = (row - cy + 3 * SIDE) % 3
                first = max(cx - outer, 0)
                across = (first - cx + 3 * SIDE) % 3
                for column in range(first, min(cx + outer, SIDE - 1) + 1):
                    if abs(column - cx) <= inner:
                        for c in range(3):
                            frames[env, row, column, c] = patches[env, body, down, across, c]
                    else:
                        for c in range(3):
                            frames[env, row, column, c] = 0
                    across = across + 1 if across < 2 else 0
