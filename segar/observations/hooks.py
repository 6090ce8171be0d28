"""The optional parts of observations, in one place: hooks, arrays of their own, the task.

:mod:`segar.observations.protocol` describes them. They are looked up by ``getattr``, because ``isinstance`` of a protocol does
not see attributes that a wrapper forwards by ``__getattr__``.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from segar.observations.protocol import Arrays, BoundObservation, Observation

if TYPE_CHECKING:
    from segar.engine import Reads
    from segar.language import Task


@dataclass(frozen=True)
class Hooks:
    """The optional methods of a bound observation, and functions that do nothing in the place of those that it lacks."""

    start: Callable[[np.ndarray, np.ndarray, np.ndarray], None]
    advance: Callable[[np.ndarray], None]
    memory: Callable[[], dict[str, np.ndarray]]
    recall: Callable[[Mapping[str, np.ndarray]], None]


def hooks_of(observation: BoundObservation) -> Hooks:
    """The hooks of a bound observation."""
    return Hooks(
        getattr(observation, "start", _do_nothing),
        getattr(observation, "advance", _do_nothing),
        getattr(observation, "memory", dict),
        getattr(observation, "recall", _do_nothing),
    )


def own_arrays(observation: BoundObservation) -> Arrays | None:
    """The arrays that the observation keeps up to date now, None if it does not own any."""
    return getattr(observation, "kept", None)


def simulator_reads(observation: BoundObservation) -> Reads | None:
    """What the simulator writes for the observation during a step, None if the observation is written after it."""
    return getattr(observation, "reads", None)


def for_task(observation: Observation, task: Task) -> Observation:
    """The observation in environments of a task: another one if it depends on the task, else the same."""
    adapt = getattr(observation, "for_task", None)
    return observation if adapt is None else adapt(task)


def _do_nothing(*arguments: Any) -> None:
    """Stand in for a hook that an observation does not have."""
