"""Stacks: the last n observations as one array."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import gymnasium
import numpy as np

from segar.errors import SegarError
from segar.observations import stack_kernel
from segar.observations.members import Members
from segar.observations.memories import remembered

if TYPE_CHECKING:
    from segar.factors import Factor
    from segar.levels import Levels
    from segar.tasks.task import Task

MOST = 255  # frames: they are counted in bytes
CHUNK = 64  # environments that are drawn and then stacked: their frames stay in the processor's cache
MOST_OF_A_PLANE = 64  # [bytes] that are moved together where the pixels of a frame do not lie side by side
SPARE = 64  # [bytes] that the kernel may read beyond the end


@dataclass(frozen=True)
class Stack:
    """The last ``n`` of what another observation shows, the newest last.

    Frames are joined along the axis of their channels (``[64, 64, 3]`` becomes ``[64, 64, 3 n]``), everything else along
    its first axis (``[d]`` becomes ``[n d]``). When an episode starts, all n are the first one. An intervention changes
    the newest one alone. Snapshots hold the stack, so that a restored or forked environment shows what it would have
    shown; restored from a snapshot of an environment that kept no stack, all n are the present one. A frame is what has
    three axes of bytes, and its channels are the last axis unless the first one is shorter.

    An environment made with ``copy=False`` returns the stack itself, which is not to be written into, and touches but what
    changed in it; the others copy it, n frames per step.

    Args:
        observation: what is stacked, or its name; its space must be a box.
        n: how many.

    Raises:
        SegarError: ``n`` is not from 1 to 255.
    """

    observation: Any
    n: int

    def __post_init__(self) -> None:
        from segar.observations.find import make_observation

        object.__setattr__(self, "observation", make_observation(self.observation))
        if not 1 <= self.n <= MOST:
            raise SegarError(f"Stack: n must be from 1 to {MOST}, not {self.n!r}")

    @property
    def members(self) -> tuple[Any, ...]:
        """What is stacked."""
        return (self.observation,)

    def shows(self, factor: type[Factor]) -> bool:
        """Whether what is stacked does."""
        return self.observation.shows(factor)

    def for_task(self, task: Task) -> Stack:
        """The stack in environments of this task."""
        from segar.observations.find import for_task

        return replace(self, observation=for_task(self.observation, task))

    def bind(self, levels: Levels, num_envs: int) -> BoundStack:
        """The stack at work; raises :class:`SegarError` if what is stacked is not one array."""
        return BoundStack(self.observation.bind(levels, num_envs), self.n, num_envs)


class BoundStack(Members):
    """:class:`Stack` in one environment; see :class:`segar.observations.protocol.Remembers`.

    Attributes:
        kept: the observations of all environments, ``[env, *space.shape]``; ``write`` keeps them up to date.
    """

    def __init__(self, member: Any, n: int, num_envs: int) -> None:
        super().__init__([member], ["stacked"])
        box = member.space
        if not isinstance(box, gymnasium.spaces.Box) or not box.shape:
            raise SegarError(
                f"Stack: it stacks arrays, not {box}; stack the parts, as in {{'pixels': Stack('rgb', 4), ...}}"
            )
        axis = joined_axis(box)
        low, high = (np.concatenate([edge] * n, axis) for edge in (box.low, box.high))
        self.space = gymnasium.spaces.Box(low, high, dtype=box.dtype)  # type: ignore[arg-type]
        self._drawn, self._newest = (_roomy((num_envs, *box.shape), box.dtype) for _ in range(2))
        self.kept = _roomy((num_envs, *self.space.shape), box.dtype)
        outer = int(np.prod(box.shape[:axis], dtype=int))
        self._shape = (num_envs, outer, n, self._drawn[0].size // outer)
        self._fresh, self._pending = np.ones(num_envs, np.bool_), np.zeros(num_envs, np.bool_)
        frame, side_by_side = self._drawn[0], axis == 2
        unit = stack_kernel.PIXELS * frame.shape[-1] if side_by_side else math.gcd(MOST_OF_A_PLANE, frame.size)
        self._is_frame = frame.ndim == 3 and frame.dtype == np.uint8 and unit % 8 == 0 and frame.size % unit == 0
        if self._is_frame:
            self._age = np.zeros((num_envs, frame.size // unit), np.uint8)
            words = (num_envs, frame.size // unit, unit // 8)
            self._words = _words(self._drawn).reshape(words), _words(self._newest).reshape(words)
            self._frames = _frames(self, n, frame.shape[2]) if side_by_side else None
            self._four_rgb = side_by_side and stack_kernel.is_of_four_rgb(n, frame.shape[2])

    def start(self, key: np.ndarray, level: np.ndarray, mask: np.ndarray) -> None:
        """The next frame fills the stacks where ``mask`` is true."""
        self._fresh[mask] = True
        super().start(key, level, mask)

    def begin(self, values: np.ndarray, level: np.ndarray, mask: np.ndarray) -> None:
        """Prepare what is stacked."""
        self.members[0].begin(values, level, mask)

    def advance(self, actions: np.ndarray) -> None:
        """The next frame is a new one."""
        self._pending[:] = True
        super().advance(actions)

    def memory(self) -> dict[str, np.ndarray]:
        """The stacks, and what the member remembers."""
        return {"stack": self.kept.copy(), **super().memory()}

    def recall(self, memory: Mapping[str, np.ndarray]) -> None:
        """Go on from these stacks."""
        super().recall(memory)
        stack = remembered(memory, "stack", self.kept)
        if stack is None:
            return
        self.kept[:] = stack
        self._newest[:] = self.kept.reshape(self._shape)[:, :, -1].reshape(self._newest.shape)
        self._fresh[:] = self._pending[:] = False
        if self._is_frame:
            self._age[:] = self._shape[2]  # what changed in which of the frames is not remembered

    def write(self, values: np.ndarray, level: np.ndarray, out: np.ndarray, rows: np.ndarray) -> None:
        """Fill ``out[rows]``; nothing is copied where ``out`` is ``kept``."""
        for first in range(0, len(rows), CHUNK):
            chunk = rows[first : first + CHUNK]
            self.members[0].write(values, level, self._drawn, chunk)
            self._push(chunk)
            if out is not self.kept:
                _copy_rows(self.kept, out, chunk)

    def _push(self, rows: np.ndarray) -> None:
        """Put what was drawn into the stacks."""
        num_envs, outer, n, inner = self._shape
        if not self._is_frame:
            drawn = self._drawn.reshape(num_envs, outer, inner)
            stack_kernel.push(rows, drawn, self.kept.reshape(self._shape), self._fresh, self._pending)
            return
        notes = self._fresh, self._pending, self._age, np.empty(self._age.shape[1], np.int64)
        if self._frames is not None:
            stack_kernel.push_pixels(rows, self._frames, *notes, self._four_rgb)
        else:
            drawn, newest = self._words
            stack_kernel.push_planes(
                rows, drawn, newest, _words(self.kept).reshape(num_envs, n, *drawn.shape[1:]), *notes
            )


def joined_axis(box: gymnasium.spaces.Box) -> int:
    """The axis along which observations are stacked: that of a frame's channels, else the first."""
    if len(box.shape) != 3 or box.dtype != np.uint8:
        return 0
    return 2 if box.shape[2] <= box.shape[0] else 0


def _roomy(shape: tuple[int, ...], dtype: Any) -> np.ndarray:
    """Zeros with spare bytes behind them, so that a wide read at the end stays inside."""
    count = int(np.prod(shape))
    base = np.zeros(count + -(-SPARE // np.dtype(dtype).itemsize), dtype)
    return base[:count].reshape(shape)


def _words(array: np.ndarray) -> np.ndarray:
    """The memory of each environment as 64-bit words."""
    return array.reshape(len(array), -1).view(np.uint64)


def _frames(stack: BoundStack, n: int, channels: int) -> stack_kernel.Frames:
    """The kernel's views of frames whose pixels lie side by side."""
    drawn_words, newest_words = stack._words
    num_envs, units = drawn_words.shape[:2]
    pixels, pixel = stack_kernel.PIXELS, n * channels  # [bytes]

    def view(array: np.ndarray, dtype: Any, first: int, pixel_bytes: int, count: int, step: int) -> np.ndarray:
        """``[env, unit, count]`` of ``array``, from byte ``first`` on, ``step`` bytes apart; may read ahead."""
        strides = (units * pixels * pixel_bytes, pixels * pixel_bytes, step)
        return np.ndarray((num_envs, units, count), dtype, array.base, first, strides)

    four = pixel == 12  # otherwise these are not read, and must not reach beyond the end
    first, tail = (0, 8) if four else (0, 0)
    return stack_kernel.Frames(
        drawn_words,
        newest_words,
        stack._drawn.reshape(num_envs, units, pixels, channels),
        _words(stack.kept).reshape(num_envs, units, n * channels),
        view(stack.kept, np.uint64, channels, pixel, n * channels, 8),
        stack.kept.reshape(num_envs, units, pixels, n, channels),
        view(stack.kept, np.uint64, first, pixel, pixels, pixel),
        view(stack.kept, np.uint64, channels, pixel, pixels, pixel),
        view(stack.kept, np.uint32, tail, pixel, pixels, pixel),
        view(stack._drawn, np.uint32, 0, channels, pixels, channels),
    )


def _copy_rows(source: np.ndarray, target: np.ndarray, rows: np.ndarray) -> None:
    """Copy these rows; a run of them in one piece."""
    first, last = int(rows[0]), int(rows[-1]) + 1
    if last - first == len(rows):
        target[first:last] = source[first:last]
    else:
        target[rows] = source[rows]
