"""Two worlds written directly in numba, as one would without SEGAR: the yardstick of the generated kernels.

Nothing here comes from the generator. The rules, their order, contacts, and the task are those of ``empty-hard`` and
``objectsx3-hard`` with PuttPutt, and a test holds both to the same trajectories. What a person knows about these worlds
is used: one ball in an empty arena lives in local variables; four discs are compared pair by pair, without lists; nothing
is a hull, and nothing else lies on the floor but the goal.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from benchmarks import handwritten_columns as at
from benchmarks.handwritten_empty import step_empty
from benchmarks.handwritten_objects import step_objects
from segar.engine.simulator import State, StepResult
from segar.language.factors import (
    Acceleration,
    Alive,
    Charge,
    Done,
    Drag,
    Friction,
    Heat,
    InfiniteEnergy,
    Magnetism,
    Mass,
    Mobile,
    Position,
    Size,
    StoredEnergy,
    Velocity,
    Visible,
)
from segar.levels.level_set import Levels

COLUMNS = (
    (Position, at.X),
    (Velocity, at.VX),
    (Acceleration, at.AX),
    (Drag, at.DX),
    (Mass, at.MASS),
    (Size, at.RADIUS),
    (Charge, at.CHARGE),
    (Magnetism, at.MAGNETISM),
    (StoredEnergy, at.ENERGY),
    (InfiniteEnergy, at.KEEPS),
    (Mobile, at.MOBILE),
    (Alive, at.ALIVE),
    (Done, at.DONE),
    (Visible, at.VISIBLE),
)


@dataclass
class Table:
    """States of one of the two worlds, float64: ``body[env, i, 18]``, ``goal[env, 5]``, ``world[env, 7]``."""

    body: np.ndarray
    goal: np.ndarray
    world: np.ndarray
    contacts: np.ndarray
    unresolved_contacts: np.ndarray
    outcome: StepResult

    @classmethod
    def of(cls, state: State, levels: Levels) -> Table:
        """The same states as SEGAR's."""
        columns = levels.layout.columns
        slots = [k for k, slot in enumerate(levels.layout.slots) if slot.must_have(Mass)]
        num_envs = len(state.level)
        body = np.zeros((num_envs, len(slots), at.VISIBLE + 1))
        for factor, column in COLUMNS:
            part = state.values[:, slots, columns[factor] : columns[factor] + factor.width]
            body[:, :, column : column + factor.width] = part
        body[:, :, at.RADIUS] *= 0.5
        tile = state.values[:, levels.layout.slot_index("goal")]
        size, friction, heat = (tile[:, columns[f]] for f in (Size, Friction, Heat))
        goal = np.column_stack([tile[:, columns[Position] : columns[Position] + 2], 0.5 * size, friction, heat])
        world = levels.parameters[state.level]
        return cls(
            body, goal, world, state.contacts.copy(), state.unresolved_contacts.copy(), StepResult.empty(num_envs)
        )

    def step(self, actions: np.ndarray, sub_steps: int = 5) -> None:
        """One step of all environments, in place; actions float32 ``[env, 2]``."""
        advance = step_empty if self.body.shape[1] == 1 else step_objects
        out = self.outcome
        advance(
            self.body, self.goal, self.world, actions, sub_steps, out.reward, out.terminated, out.success, out.death,
            self.contacts, self.unresolved_contacts,
        )  # fmt: skip
