"""The range of actions: the task's own, or [-1, 1] in each component, which is mapped linearly to it."""

from typing import Any

import numpy as np

from segar.language import Task


class ActionRange:
    """The range of the actions of a batch of environments.

    Args:
        unit: whether each component lies in [-1, 1]; otherwise actions have the task's range.

    Attributes:
        low, high: float32 ``(action size,)``, the ends of the action space.
        is_mapped: whether actions differ from those of the task.
        center, half_range: float32 ``(action size,)``, of the task's range.
    """

    def __init__(self, task: Task, unit: bool) -> None:
        low, high = np.array(task.action_low, np.float32), np.array(task.action_high, np.float32)
        self.center, self.half_range = (low + high) / 2, (high - low) / 2
        self.is_mapped = unit and not ((low == -1).all() and (high == 1).all())
        self.low, self.high = (-np.ones_like(low), np.ones_like(high)) if unit else (low, high)

    def of_task(self, actions: np.ndarray) -> np.ndarray:
        """Actions of the action space ``[..., action size]`` as the task has them, float32."""
        actions = np.asarray(actions, np.float32)
        return self.center + self.half_range * np.clip(actions, -1, 1) if self.is_mapped else actions

    def of_space(self, actions: Any) -> np.ndarray:
        """Actions of the task ``[..., action size]`` as the action space has them, float32."""
        actions = np.asarray(actions, np.float32)
        return (actions - self.center) / self.half_range if self.is_mapped else actions
