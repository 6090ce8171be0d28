"""The past of an episode as an observation: the last actions; and the last action with its reward and what has just begun."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import gymnasium
import numpy as np
from numpy.typing import ArrayLike

from segar.engine import Call, Given, Rows, call_of
from segar.errors import SegarError
from segar.language import Factor, Task
from segar.levels import Levels
from segar.observations.composed.composed import recall_array
from segar.observations.composed.past_on_targets import SIZES, forget_actions, note_actions, show_actions
from segar.observations.state.state_options import FACTOR_LIMIT
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


class BoundPast:
    """Numbers of the past in one batch of environments, which snapshots hold under a name.

    Args:
        low, high: float ``(numbers,)``, the bounds of the numbers.
    """

    draws_per_episode = False

    def __init__(self, name: str, low: ArrayLike, high: ArrayLike, num_envs: int) -> None:
        self.space = gymnasium.spaces.Box(np.array(low, np.float32), np.array(high, np.float32), dtype=np.float32)
        self._name, self._numbers = name, np.zeros((num_envs, *self.space.shape), np.float32)

    def begin(self, values: np.ndarray, level: np.ndarray, mask: np.ndarray) -> None:
        """Nothing to prepare."""

    def memory(self) -> dict[str, np.ndarray]:
        """A copy of the numbers."""
        return {self._name: self._numbers.copy()}

    def recall(self, memory: Mapping[str, np.ndarray]) -> None:
        """Remember the numbers in ``memory``."""
        recall_array(memory, self._name, self._numbers)

    def write(self, values: np.ndarray, level: np.ndarray, out: np.ndarray, rows: np.ndarray) -> None:
        """Fill ``out[rows]``."""
        out[rows] = self._numbers[rows]


class BoundPreviousActions(BoundPast):
    """:class:`PreviousActions` in one environment."""

    def __init__(self, n: int, task: Task, num_envs: int) -> None:
        self._low, self._high = np.array(task.action_low, np.float32), np.array(task.action_high, np.float32)
        self._size = len(self._low)
        low, high = np.tile(np.minimum(self._low, 0), n), np.tile(np.maximum(self._high, 0), n)  # 0: no action yet
        super().__init__("actions", low, high, num_envs)

    def start(self, key: np.ndarray, level: np.ndarray, mask: np.ndarray) -> None:
        """Forget the actions of earlier episodes."""
        self._numbers[mask] = 0.0

    def advance(self, actions: np.ndarray) -> None:
        """Remember the actions of a step."""
        self._numbers[:, : -self._size] = self._numbers[:, self._size :]
        np.clip(actions, self._low, self._high, out=self._numbers[:, -self._size :])

    def calls(self, when: str, in_rows: bool = False) -> list[Call]:
        """What ``start``, ``advance`` and ``write`` do, for other targets; see :class:`segar.observations.RunsOnTargets`."""
        past, length = self._numbers, self._numbers.shape[1]
        if when == "start":
            return [call_of("forget_actions", forget_actions, [Rows(), past], SIZES)]
        if when == "advance":
            given = Given("float32", ("envs", self._size))
            return [call_of("note_actions", note_actions, [Rows(), given, self._low, self._high, past], SIZES)]
        if when == "write":
            return [call_of("show_actions", show_actions, [Rows(), past, Given("float32", ("envs", length))], SIZES)]
        return []


@dataclass(frozen=True)
class PreviousStep:
    """Whether an episode has just begun, the last action and its reward: float32 ``[1 + action size + 1]``.

    The first number is 1 where no step of the episode was taken, else 0. The action is clipped to its range. Over the trials
    of a level, which are episodes in a row (``trials`` of :class:`segar.envs.VectorEnv`), action and reward are remembered: the
    first observation of a trial shows those of the last step of the trial before. They are 0 where a level begins. A policy
    with a memory can learn from this what came of the earlier trials (Duan et al. 2016, RL²).

    Args:
        reward_scale: what rewards are divided by; afterwards they are clipped to 1e6.
        task: the task of the actions; environments give theirs. The task that the levels name where it is None.

    Raises:
        SegarError: the scale is no finite number above 0.
    """

    reward_scale: float = 1.0
    task: Task | None = None

    def __post_init__(self) -> None:
        scale = self.reward_scale
        if isinstance(scale, bool) or not isinstance(scale, (int, float)) or not 0 < scale < np.inf:
            raise SegarError(f"PreviousStep: reward_scale must be a finite number above 0, not {scale!r}")

    def shows(self, factor: type[Factor]) -> bool:
        """Whether the last action and its reward change with the factor's present values: never."""
        return False

    def for_task(self, task: Task) -> PreviousStep:
        """The steps of this task."""
        return replace(self, task=task)

    def bind(self, levels: Levels, num_envs: int) -> BoundPreviousStep:
        """The observation at work."""
        return BoundPreviousStep(self, self.task or task_of(levels), num_envs)


class BoundPreviousStep(BoundPast):
    """:class:`PreviousStep` in one batch of environments.

    Attributes:
        names: what each number is: ``episode.begins``, ``action.0`` and so on, ``reward``.
    """

    def __init__(self, step: PreviousStep, task: Task, num_envs: int) -> None:
        self._low, self._high = np.array(task.action_low, np.float32), np.array(task.action_high, np.float32)
        self._scale = float(step.reward_scale)
        self.names = ["episode.begins", *(f"action.{k}" for k in range(len(self._low))), "reward"]
        low = [0.0, *np.minimum(self._low, 0), -FACTOR_LIMIT]  # 0: no action yet
        high = [1.0, *np.maximum(self._high, 0), FACTOR_LIMIT]
        super().__init__("step", low, high, num_envs)

    def forget(self, mask: np.ndarray) -> None:
        """Forget action and reward where a level begins."""
        self._numbers[mask] = 0.0

    def start(self, key: np.ndarray, level: np.ndarray, mask: np.ndarray) -> None:
        """Note that episodes begin where ``mask`` is true."""
        self._numbers[mask, 0] = 1.0

    def advance(self, actions: np.ndarray) -> None:
        """Remember the actions of a step."""
        self._numbers[:, 0] = 0.0
        np.clip(actions, self._low, self._high, out=self._numbers[:, 1:-1])

    def rewarded(self, reward: np.ndarray) -> None:
        """Remember the rewards of a step."""
        self._numbers[:, -1] = np.clip(reward / self._scale, -FACTOR_LIMIT, FACTOR_LIMIT)
