"""What the interpreter makes of a state, to be read by names of entities and factors, and which rules said what."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np

from segar.language import Effect, Factor, Rule
from segar.reference.reference_state import Scene


@dataclass(frozen=True)
class Firing:
    """A rule that said something: in which stage, about which entities (by name), and what."""

    stage: str
    rule: Rule
    entities: tuple[str, ...]
    effects: tuple[Effect, ...]

    def __str__(self) -> str:
        said = ", ".join(map(repr, self.effects))
        return f"{self.stage}: {self.rule.name}({', '.join(self.entities)}) -> {said}"


@dataclass
class Result:
    """What a step made of a state.

    Attributes:
        scene: the state with names, types and geometry; :meth:`read` asks it.
        values: float64 ``(entities, columns)``.
        tick: sub-steps since the episode began.
        contacts: contacts of this step.
        gave_up: sub-steps of this step whose time ran out in contacts.
        reward, terminated, success, death: what the task says; None for a step without an action.
        firings: which rules said what, in order, if asked for.
    """

    scene: Scene = field(repr=False)
    values: np.ndarray
    tick: int
    contacts: int = 0
    gave_up: int = 0
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
        slot = self.scene.layout.slot_index(entity)
        column = self.scene.column(slot, factor)
        part = tuple(map(float, self.values[slot, column : column + factor.width]))  # type: ignore[attr-defined]
        return part[0] if len(part) == 1 else part
