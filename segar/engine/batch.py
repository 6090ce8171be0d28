"""The arrays that a kernel steps: the states of a batch, what is fixed in their levels, and the results of a step."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from segar.language import Layout


@dataclass
class State:
    """A batch of environment states; arrays lead with the environment.

    Attributes:
        values: float64 ``(num_envs, entities, columns)``.
        level: int64 ``(num_envs,)``, index in the level set.
        key: uint64 ``(num_envs,)``, key of the randomness in rules.
        tick: int64 ``(num_envs,)``, sub-steps since the episode began.
        contacts: int64 ``(num_envs,)``, contacts since the episode began.
        unresolved_contacts: int64 ``(num_envs,)``, sub-steps since the episode began that had more contacts than are
            resolved; overlapping bodies were pushed apart there.
    """

    values: np.ndarray
    level: np.ndarray
    key: np.ndarray
    tick: np.ndarray
    contacts: np.ndarray
    unresolved_contacts: np.ndarray

    @classmethod
    def empty(cls, num_envs: int, layout: Layout) -> State:
        """States without entities (all values are nan), of level 0 and at tick 0."""
        return cls(
            values=np.full((num_envs, len(layout.slots), layout.width), np.nan),
            level=np.zeros(num_envs, np.int64),
            key=np.zeros(num_envs, np.uint64),
            tick=np.zeros(num_envs, np.int64),
            contacts=np.zeros(num_envs, np.int64),
            unresolved_contacts=np.zeros(num_envs, np.int64),
        )

    def copy(self) -> State:
        return replace(self, **{name: array.copy() for name, array in vars(self).items()})


@dataclass
class StepResult:
    """The results of a step by the task; arrays of length ``num_envs``, overwritten by the next step.

    Attributes:
        reward: float64.
        terminated, success, death: bool.
    """

    reward: np.ndarray
    terminated: np.ndarray
    success: np.ndarray
    death: np.ndarray

    @classmethod
    def empty(cls, num_envs: int) -> StepResult:
        return cls(np.zeros(num_envs), *(np.zeros(num_envs, np.bool_) for _ in range(3)))


@dataclass(frozen=True)
class LevelArrays:
    """What is fixed in each level of a set, by level and entity.

    Attributes:
        bits: int64 ``(levels, entities)``, what the entity's type matches; 0 for an absent entity.
        kind: int8 ``(levels, entities)``, kind of the shape; see :mod:`segar.language.shapes`.
        count: int16 ``(levels, entities)``, vertices of the hull.
        vertex: float64 ``(levels, entities, room, 2)``, vertices relative to the entity's position.
        hull_radius: float64 ``(levels, entities)``, radius of the hull's circumscribed disc.
        parameters: float64 ``(levels, parameters)``, world parameters.
    """

    bits: np.ndarray
    kind: np.ndarray
    count: np.ndarray
    vertex: np.ndarray
    hull_radius: np.ndarray
    parameters: np.ndarray
