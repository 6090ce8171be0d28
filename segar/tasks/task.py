"""A task: what an action does, what is rewarded, and when an episode is over, as typed functions."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from segar.engine.task_functions import TaskFunctions
from segar.errors import SegarError
from segar.rule import as_rule, value_rule


@dataclass(frozen=True)
class Task:
    """A task, compiled into the kernel together with the rules.

    Each function takes entities, factors and parameters by type, as rules do. ``reward`` is summed over all tuples of
    entities that match; ``terminated``, ``success`` and ``death`` hold if they hold for any.

    Attributes:
        act: rule with an ``Action``; applied once per step before the first sub-step, differentials unscaled.
        reward: number, evaluated once per step after the last sub-step.
        terminated: truth, evaluated after every sub-step; the step ends where it holds.
        success: truth, evaluated at the end of the step; said in ``info``.
        death: truth, evaluated at the end of the step; said in ``info``.
        action_low, action_high: range of each number of the action; values outside are clipped.
        max_steps: an episode is truncated after this many steps.
        sub_steps: sub-steps per step.
    """

    name: str
    act: Callable[..., Any]
    reward: Callable[..., Any]
    terminated: Callable[..., Any]
    success: Callable[..., Any]
    death: Callable[..., Any]
    action_low: tuple[float, ...] = (-1.0, -1.0)
    action_high: tuple[float, ...] = (1.0, 1.0)
    max_steps: int = 100
    sub_steps: int = 5

    def __post_init__(self) -> None:
        if len(self.action_low) != len(self.action_high) or not self.action_low:
            raise SegarError(f"task {self.name}: action_low and action_high must have the same length, at least 1")
        for name in ("max_steps", "sub_steps"):
            if int(getattr(self, name)) < 1:
                raise SegarError(f"task {self.name}: {name} must be at least 1, not {getattr(self, name)}")

    def functions(self) -> TaskFunctions:
        """The traced functions; raises :class:`RuleError`."""
        return TaskFunctions(
            act=as_rule(self.act),
            reward=value_rule(self.reward, truth=False),
            terminated=value_rule(self.terminated, truth=True),
            success=value_rule(self.success, truth=True),
            death=value_rule(self.death, truth=True),
            action_low=tuple(map(float, self.action_low)),
            action_high=tuple(map(float, self.action_high)),
        )
