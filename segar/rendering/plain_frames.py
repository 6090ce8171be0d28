"""Frames of environments without pygame: what :class:`segar.observations.Pixels` draws, as large as a view asks for."""

from collections.abc import Sequence

import numpy as np

from segar.engine import State
from segar.levels import Levels
from segar.observations import Pixels
from segar.rendering.scene import View

LARGEST = 256  # [px] the side of the largest frame that Pixels draws; larger ones repeat pixels
MULTIPLE = 4  # of which the side is one


class PlainFrames:
    """Draws the environments of a batch, of which there are ``num_envs``, on these levels."""

    def __init__(self, levels: Levels, view: View, num_envs: int) -> None:
        side = min(view.size // MULTIPLE * MULTIPLE, LARGEST)
        self._view, self._num_envs = view, num_envs
        self._pixels = Pixels(side, colours=view.colours).bind(levels, num_envs)
        self._nearest = np.arange(view.size) * side // view.size
        self._drawn = np.empty((num_envs, side, side, 3), np.uint8)

    def frames(self, state: State, rows: Sequence[int]) -> list[np.ndarray]:
        """A frame of each environment in ``rows``, uint8 ``view.shape``; the line below the arena is black."""
        everywhere = np.arange(self._num_envs)
        self._pixels.begin(state.values, state.level, np.ones(self._num_envs, np.bool_))
        self._pixels.write(state.values, state.level, self._drawn, everywhere)
        frames = []
        for row in rows:
            frame = np.zeros(self._view.shape, np.uint8)
            frame[: self._view.size] = self._drawn[row][self._nearest[:, None], self._nearest]
            frames.append(frame)
        return frames
