"""State vectors: the factors of all things in fixed places, float32."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import gymnasium
import numpy as np

from segar.factors import Acceleration, Density, Done, Drag, Factor, InfiniteEnergy, Order, Position, Visible
from segar.observations import state_kernel

if TYPE_CHECKING:
    from segar.levels import Levels

HIDDEN: tuple[type[Factor], ...] = (Acceleration, Drag, Density, Done, InfiniteEnergy, Order, Visible)
"""Not shown unless asked for: they follow from others, concern drawing, or no rule reads them."""
FACTOR_LIMIT = 1e6  # values beyond are clipped, so that observations stay finite


@dataclass(frozen=True)
class StateVector:
    """A float32 vector: per slot its factors, and one number per type where the level decides the type.

    The length depends on the distribution alone. Where an entity is absent or lacks a factor of its slot, the number
    is 0; the type numbers (1 for the type that fills the slot) tell this from a true 0. What is invisible to pixels
    (Invisiball's ball, what is dead or swallowed) is shown like everything else, unless it is not to be seen.

    Args:
        hidden: factors that are not shown. Factors of the user's own are shown.
        sees_invisible: whether things are shown that are not Visible; otherwise their numbers are 0.
    """

    hidden: tuple[type[Factor], ...] = HIDDEN
    sees_invisible: bool = True

    def bind(self, levels: Levels, num_envs: int) -> BoundStateVector:
        """The observation at work on these levels."""
        return BoundStateVector(self, levels)


class BoundStateVector:
    """:class:`StateVector` in one environment; ``names`` says what each number is, e.g. ``golfball.Position.x``."""

    def __init__(self, state: StateVector, levels: Levels) -> None:
        layout = levels.layout
        reads: list[tuple[int, int, int, int]] = []  # (slot, column, place in the vector, column that must be true)
        type_reads: list[tuple[int, int, int]] = []  # (place in the vector, slot, type)
        self.names: list[str] = []
        for index, slot in enumerate(layout.slots):
            if not slot.may_have(Position):
                continue  # an abstract entity such as the floor
            needs = -1 if state.sees_invisible else layout.columns.get(Visible, -1)
            for factor in layout.factors:
                if factor in state.hidden or not any(factor in t.declared for t in slot.types):
                    continue
                for component in range(factor.width):
                    reads.append((index, layout.columns[factor] + component, len(self.names), needs))
                    suffix = f".{'xy'[component]}" if factor.width == 2 else ""
                    self.names.append(f"{slot.name}.{factor.__name__}{suffix}")
            if slot.optional or len(slot.types) > 1:
                for kind in slot.types:
                    type_reads.append((len(self.names), index, layout.types.index(kind)))
                    self.names.append(f"{slot.name}.is_{kind.__name__}")
        self._reads = np.array(reads, np.int64).reshape(-1, 4)
        self._type_reads = np.array(type_reads, np.int64).reshape(-1, 3)
        self._types = levels.types
        self.space = gymnasium.spaces.Box(-FACTOR_LIMIT, FACTOR_LIMIT, (len(self.names),), np.float32)

    def begin(self, values: np.ndarray, level: np.ndarray, mask: np.ndarray) -> None:
        """Nothing to prepare."""

    def write(self, values: np.ndarray, level: np.ndarray, out: np.ndarray, rows: np.ndarray) -> None:
        """Fill ``out[rows]``, float32 ``[env, length]``."""
        state_kernel.gather(values, level, rows, self._types, self._reads, self._type_reads, FACTOR_LIMIT, out)
