"""The last actions of the agent, as an observation."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import gymnasium
import numpy as np

from segar.engine import Call, Given, Rows, call_of
from segar.errors import SegarError
from segar.language import Factor, Task
from segar.levels import Levels
from segar.observations.composed.composed import recall_array
from segar.observations.composed.past_on_targets import SIZES, forget_actions, note_actions, show_actions
from segar.tasks import task_of


@dataclass(frozen=True)
class PreviousActions:
    """The last ``n`` actions as they were taken, clipped to their range: float32 ``[n * action size]``, newest last.

    Zeros stand for those before the episode began.

    Args:
        n: how many.
        task: the task of the actions; environments give theirs. The task that the levels name where it is None.

    Raises:
        SegarError: ``n`` is less than 1.
    """

    n: int = 1
    task: Task | None = None

    def __post_init__(self) -> None:
        if self.n < 1:
            raise SegarError(f"PreviousActions: n must be at least 1, not {self.n!r}")

    def shows(self, factor: type[Factor]) -> bool:
        """Whether actions change with the factor: never."""
        return False

    def for_task(self, task: Task) -> PreviousActions:
        """The actions of this task."""
        return replace(self, task=task)

    def bind(self, levels: Levels, num_envs: int) -> BoundPreviousActions:
        """The observation at work."""
        return BoundPreviousActions(self.n, self.task or task_of(levels), num_envs)


class BoundPreviousActions:
    """:class:`PreviousActions` in one environment; see :class:`segar.observations.protocol.HasMemory`."""

    draws_per_episode = False

    def __init__(self, n: int, task: Task, num_envs: int) -> None:
        self._low, self._high = np.array(task.action_low, np.float32), np.array(task.action_high, np.float32)
        self._size = len(self._low)
        low, high = np.tile(np.minimum(self._low, 0), n), np.tile(np.maximum(self._high, 0), n)  # 0: no action yet
        self.space = gymnasium.spaces.Box(low, high, dtype=np.float32)
        self._actions = np.zeros((num_envs, n * self._size), np.float32)

    def start(self, key: np.ndarray, level: np.ndarray, mask: np.ndarray) -> None:
        """Forget the actions of earlier episodes."""
        self._actions[mask] = 0.0

    def begin(self, values: np.ndarray, level: np.ndarray, mask: np.ndarray) -> None:
        """Nothing to prepare."""

    def advance(self, actions: np.ndarray) -> None:
        """Remember the actions of a step."""
        self._actions[:, : -self._size] = self._actions[:, self._size :]
        np.clip(actions, self._low, self._high, out=self._actions[:, -self._size :])

    def memory(self) -> dict[str, np.ndarray]:
        """A copy of the actions."""
        return {"actions": self._actions.copy()}

    def recall(self, memory: Mapping[str, np.ndarray]) -> None:
        """Remember the actions in ``memory``."""
        recall_array(memory, "actions", self._actions)

    def write(self, values: np.ndarray, level: np.ndarray, out: np.ndarray, rows: np.ndarray) -> None:
        """Fill ``out[rows]``."""
        out[rows] = self._actions[rows]

    def calls(self, when: str, in_rows: bool = False) -> list[Call]:
        """What ``start``, ``advance`` and ``write`` do, for other targets; see :class:`segar.observations.RunsOnTargets`."""
        past, length = self._actions, self._actions.shape[1]
        if when == "start":
            return [call_of("forget_actions", forget_actions, [Rows(), past], SIZES)]
        if when == "advance":
            given = Given("float32", ("envs", self._size))
            return [call_of("note_actions", note_actions, [Rows(), given, self._low, self._high, past], SIZES)]
        if when == "write":
            return [call_of("show_actions", show_actions, [Rows(), past, Given("float32", ("envs", length))], SIZES)]
        return []
