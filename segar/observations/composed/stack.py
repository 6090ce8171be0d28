"""Stacks: the last n observations as one array, in memory in which a step moves no frame."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import gymnasium
import numpy as np

from segar.engine import Call, Given, Rows, call_of, with_array
from segar.errors import SegarError
from segar.levels import Levels
from segar.observations.composed.composed import BoundComposed, Composed, recall_array
from segar.observations.composed.multi import make_observation
from segar.observations.composed.past_on_targets import DRAWN, SIZES, advance_stacks, mark_stacks, write_stacks
from segar.observations.copying import copy_rows
from segar.observations.protocol import BoundObservation, DrawsPlanes, calls_of

TAPE = 64  # steps until the frames have to be moved
CHUNK = 64  # environments whose frames are copied while they are in the processor's cache


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


@dataclass(frozen=True)
class Stack(Composed):
    """The last ``n`` of what another observation shows, the newest last.

    Frames are joined along the axis of their channels (``[64, 64, 3]`` becomes ``[64, 64, 3 n]``), everything else along
    its first axis (``[d]`` becomes ``[n d]``). When an episode starts, all n are the first one. An intervention changes
    the newest one alone. Snapshots hold the stack, so that a restored or forked environment shows what it would have
    shown. Restored from a snapshot of an environment that kept no stack, all n are the present one. An array of three axes
    of bytes counts as a frame, and its channels are the last axis unless the first one is shorter.

    An environment made with ``copy=False`` returns the stack itself, which is not to be written into, and draws one frame
    per step. Each step returns another view of its memory, and where channels come last, they lie in planes there: the
    array is contiguous once it is transposed to ``[env, channel, row, column]``, and
    :func:`segar.observations.copying.copy_rows` is the fast way to copy it into one that is contiguous as it is. The other
    environments do so themselves, which takes n frames per step.

    Args:
        observation: what is stacked, or its name; its space must be a box.
        n: how many.

    Raises:
        SegarError: ``n`` is less than 1.
    """

    MADE_OF = "observation"
    observation: Any
    n: int

    def __post_init__(self) -> None:
        object.__setattr__(self, "observation", make_observation(self.observation))
        if self.n < 1:
            raise SegarError(f"Stack: n must be at least 1, not {self.n!r}")

    def bind(self, levels: Levels, num_envs: int) -> BoundStack:
        """The stack at work; raises :class:`SegarError` if what is stacked is not one array."""
        if isinstance(self.observation, DrawsPlanes):
            return BoundStack(
                self.observation.in_planes().bind(levels, num_envs), self.n, num_envs, self.observation.channels
            )
        return BoundStack(self.observation.bind(levels, num_envs), self.n, num_envs)


class BoundStack(BoundComposed):
    """:class:`Stack` in one batch of environments, with a memory and with arrays of its own.

    Args:
        member: the observation that is stacked.
        channels: which axis of the stack is that of the channels, "first" or "last", where ``member`` writes frames with
            channels first straight into the stack. Where it is None, ``member`` writes the form of its space into an array
            beside the stack, which is then copied.

    Attributes:
        kept: the stacks of all environments, ``[env, *space.shape]``, a view of memory that ``write`` keeps up to date; after
            ``advance`` it is another view.
    """

    def __init__(self, member: BoundObservation, n: int, num_envs: int, channels: str | None = None) -> None:
        super().__init__([member], ["stacked"])
        box = member.space
        if not isinstance(box, gymnasium.spaces.Box) or not box.shape:
            raise SegarError(
                f"Stack: it stacks arrays, not {box}; stack the parts, as in {{'pixels': Stack('rgb', 4), ...}}"
            )
        self._drawn = None if channels else np.zeros((num_envs, *box.shape), box.dtype)
        edges = [np.moveaxis(edge, 0, 2) if channels == "last" else edge for edge in (box.low, box.high)]
        axis = joined_axis(edges[0])
        low, high = (np.concatenate([edge] * n, axis) for edge in edges)
        self.space = gymnasium.spaces.Box(low, high, dtype=box.dtype)  # type: ignore[arg-type]
        shape = edges[0].shape
        self._turned = axis == 2  # the axis that is joined lies first in memory, and last in the observation
        self._tape = FrameTape(num_envs, n, (shape[2], *shape[:2]) if self._turned else shape, box.dtype)
        self._fresh = np.ones(num_envs, np.bool_)
        self.kept = self._view_of_stacks()

    def start(self, key: np.ndarray, level: np.ndarray, mask: np.ndarray) -> None:
        """Let the next frame fill the stacks where ``mask`` is true."""
        self._fresh[mask] = True
        super().start(key, level, mask)

    def advance(self, actions: np.ndarray) -> None:
        """Make each frame one older; the next ``write`` draws the newest."""
        self._tape.advance()
        self.kept = self._view_of_stacks()
        super().advance(actions)

    def memory(self) -> dict[str, np.ndarray]:
        """A copy of the stacks, and what the stacked observation remembers."""
        stack = np.empty(self.kept.shape, self.kept.dtype)
        copy_rows(self.kept, stack)
        return {"stack": stack, **super().memory()}

    def recall(self, memory: Mapping[str, np.ndarray]) -> None:
        """Go on from the stacks in ``memory``."""
        super().recall(memory)
        if recall_array(memory, "stack", self.kept):
            self._fresh[:] = False

    def write(self, values: np.ndarray, level: np.ndarray, out: np.ndarray, rows: np.ndarray) -> None:
        """Fill ``out[rows]``; nothing is copied where ``out`` is ``kept``."""
        at_once = len(self._fresh) if out is self.kept and self._drawn is None else CHUNK
        for first in range(0, len(rows), at_once):
            some = rows[first : first + at_once]
            self._draw(values, level, some)
            fresh = some[self._fresh[some]]
            if len(fresh):
                self._tape.stacks[fresh, :-1] = self._tape.stacks[fresh, -1:]
                self._fresh[fresh] = False
            if out is not self.kept:
                copy_rows(self.kept, out, some)

    def calls(self, when: str, in_rows: bool = False) -> list[Call]:
        """What ``start``, ``begin``, ``advance`` and ``write`` do, for other targets; see
        :class:`segar.observations.protocol.RunsOnTargets`.

        The stacked observation is written into an array ``drawn``. The stacks are those that this object has now, so that a
        snapshot is taken from them and restored into them; they fit as long as only the calls advance.
        """
        found = calls_of(self.members[0], when, in_rows)
        parts, things = (self.space.shape[1], "frame_rows") if in_rows and len(self.space.shape) == 3 else (1, "rows")
        drawn, stacks = self._history
        if when == "start":
            return [call_of("start_stacks", mark_stacks, [Rows(), True, self._fresh], SIZES), *found]
        if when == "advance":
            return [call_of("advance_stacks", advance_stacks, [Rows(things), parts, stacks], SIZES), *found]
        if when == "write":
            turns = self._turned and self._drawn is not None, self._turned
            out = Given(drawn.dtype.name, ("envs", drawn.shape[1] * stacks.shape[1]))
            arguments = [Rows(things), parts, *turns, drawn, self._fresh, stacks, out]
            write = call_of("write_stacks", write_stacks, arguments, SIZES)
            settle = call_of("settle_stacks", mark_stacks, [Rows(), False, self._fresh], SIZES)
            return [*(with_array(call, drawn, DRAWN) for call in found), write, settle]
        return found

    @cached_property
    def _history(self) -> tuple[np.ndarray, np.ndarray]:
        """The arrays ``drawn`` and ``stacks`` of :meth:`calls`, as :func:`write_stacks` has them."""
        num_envs, n, joined, *others = self._tape.stacks.shape
        planes, pixels = (joined, math.prod(others)) if self._turned else (1, joined * math.prod(others))
        drawn = np.zeros((num_envs, planes * pixels), self.kept.dtype)
        return drawn, self._tape.stacks.reshape(num_envs, n, planes, pixels)

    def _draw(self, values: np.ndarray, level: np.ndarray, rows: np.ndarray) -> None:
        """Write the newest frames of these environments into the stacks."""
        newest = self._tape.stacks[:, -1]
        if self._drawn is None:
            self.members[0].write(values, level, newest, rows)
        else:
            self.members[0].write(values, level, self._drawn, rows)
            copy_rows(self._drawn, newest.transpose(0, 2, 3, 1) if self._turned else newest, rows)

    def _view_of_stacks(self) -> np.ndarray:
        """The stacks of all environments as the observation has them."""
        num_envs, n, joined, *others = self._tape.stacks.shape
        stacks = self._tape.stacks.reshape(num_envs, n * joined, *others)
        return stacks.transpose(0, 2, 3, 1) if self._turned else stacks


def joined_axis(edge: np.ndarray) -> int:
    """The axis along which observations like this one are stacked: that of a frame's channels, else the first."""
    if edge.ndim != 3 or edge.dtype != np.uint8:
        return 0
    return 2 if edge.shape[2] <= edge.shape[0] else 0
