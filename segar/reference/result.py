"""The result of an interpreter's step, to be read by names of entities and factors, and the rules that fired in it."""

from dataclasses import dataclass, field
from typing import Any

import numpy as np

from segar.language import Effect, Factor, Rule
from segar.reference.reference_state import ReferenceState


@dataclass(frozen=True)
class Firing:
    """A rule that had effects: in which stage, on which entities (by name), and which effects."""

    stage: str
    rule: Rule
    entities: tuple[str, ...]
    effects: tuple[Effect, ...]

    def __str__(self) -> str:
        effects = ", ".join(map(repr, self.effects))
        return f"{self.stage}: {self.rule.name}({', '.join(self.entities)}) -> {effects}"


@dataclass
class Result:
    """The result of a step.

    Attributes:
        state: the state after the step with names, types and geometry; :meth:`read` reads it.
        values: float64 ``(entities, columns)``.
        tick: sub-steps since the episode began.
        contacts: contacts of this step.
        unresolved_contacts: sub-steps of this step that had more contacts than are resolved.
        reward, terminated, success, death: results of the task; None for a step without an action.
        firings: the rules that had effects, in order, if ``explain`` was given.
    """

    state: ReferenceState = field(repr=False)
    values: np.ndarray
    tick: int
    contacts: int = 0
    unresolved_contacts: int = 0
    reward: float | None = None
    terminated: bool | None = None
    success: bool | None = None
    death: bool | None = None
    firings: list[Firing] = field(default_factory=list)

    def read(self, entity: str, factor: type[Factor]) -> Any:
        """The factor of the entity of that name: a float, or two for a vector.

        Raises:
            SegarError: there is no such entity, or it has no such factor.
        """
        slot = self.state.layout.slot_index(entity)
        column = self.state.column(slot, factor)
        part = tuple(map(float, self.values[slot, column : column + factor.width]))
        return part[0] if len(part) == 1 else part
