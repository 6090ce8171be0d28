"""Memory of the last n frames of each environment, in which a step moves no frame; and its plain twin.

The tape holds the stacks of all environments side by side, the oldest frame of each first. A step moves the place where the
tape is read by one frame. Every frame is then one older, and the newest of each environment takes the place of what was the
oldest of the next environment. At the end of the tape, all frames are moved back to its start.
"""

import numpy as np

from segar.support import is_plain

TAPE = 64  # steps until the frames have to be moved


class FrameTape:
    """The last ``n`` frames of each environment.

    Attributes:
        stacks: ``[env, n, *frame]``, the newest frame last; after :meth:`advance` it is another view.
    """

    def __init__(self, num_envs: int, n: int, frame: tuple[int, ...], dtype: np.dtype) -> None:
        self._shape = (num_envs, n, *frame)
        self._tape = np.zeros((num_envs * n + TAPE, *frame), dtype)
        self._read_from(0)

    def advance(self) -> None:
        """Make each frame one older. The newest frames are to be written."""
        if self._first < TAPE:
            self._read_from(self._first + 1)
        else:
            past = self._tape[self._first + 1 :]
            for frame in range(0, len(past), TAPE):  # pieces that do not reach into where they come from
                self._tape[frame : frame + TAPE][: len(past) - frame] = past[frame : frame + TAPE]
            self._read_from(0)

    def _read_from(self, first: int) -> None:
        self._first = first
        self.stacks = self._tape[first : first + self._shape[0] * self._shape[1]].reshape(self._shape)


class PlainFrameTape:
    """The plain twin of :class:`FrameTape`: each step moves all frames by one place."""

    def __init__(self, num_envs: int, n: int, frame: tuple[int, ...], dtype: np.dtype) -> None:
        self.stacks = np.zeros((num_envs, n, *frame), dtype)

    def advance(self) -> None:
        """Make each frame one older. The newest frames are to be written."""
        self.stacks[:, :-1] = self.stacks[:, 1:].copy()


def make_tape(num_envs: int, n: int, frame: tuple[int, ...], dtype: np.dtype) -> FrameTape | PlainFrameTape:
    """Memory for the last ``n`` frames of each environment, 0 at first."""
    return (PlainFrameTape if is_plain() else FrameTape)(num_envs, n, frame, dtype)
