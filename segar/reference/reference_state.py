"""The state of one environment as the interpreter reads and writes it, and its geometry."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import lru_cache
from itertools import product
from typing import TYPE_CHECKING, Any

import numpy as np

from segar.errors import SegarError
from segar.language import (
    CIRCLE,
    HULL,
    Action,
    Collides,
    Entity,
    Factor,
    Floor,
    Layout,
    Number,
    Order,
    Parameter,
    Pattern,
    Position,
    Size,
    Source,
    Text,
    VectorValue,
    Velocity,
    Wall,
    WallView,
)
from segar.language import holds as find_held

if TYPE_CHECKING:
    from segar.levels import Levels

TOUCH = 1e-7  # [m] closer than this counts as touching; 2022 uses the same

holds = lru_cache(maxsize=4096)(find_held)


@dataclass
class ReferenceState:
    """One environment: its entities' types and values, its shapes and its parameters.

    Attributes:
        types: type of each slot's entity, None where it is absent.
        values: float64 ``(entities, columns)``; changed in place.
        kinds: shape kind of each slot; see :mod:`segar.language.shapes`.
        hulls: float64 ``(vertices, 2)`` of each slot, relative to its position; empty where it is no hull.
        key, tick: key of the randomness in rules, and sub-steps since the episode began.
        walls: distance of the arena's walls from its middle [m].
    """

    layout: Layout
    types: list[type[Entity] | None]
    values: np.ndarray
    kinds: list[int]
    hulls: list[np.ndarray]
    parameters: dict[type[Parameter], float]
    key: int
    tick: int
    walls: float

    @classmethod
    def of_level(
        cls, levels: Levels, index: int, values: np.ndarray | None, key: int, tick: int, walls: float
    ) -> ReferenceState:
        """The initial state of a level, or ``values`` in it (float64 ``(entities, columns)``, copied)."""
        layout, row = levels.layout, levels.values[index] if values is None else np.asarray(values)
        if row.shape != levels.values.shape[1:]:
            raise SegarError(f"the state of a level has the shape {levels.values.shape[1:]}, not {row.shape}")
        names: list[type[Entity] | None] = [*layout.types, None]
        counts = levels.vertex_count[index]
        return cls(
            layout=layout,
            types=[names[t] for t in levels.types[index]],
            values=np.array(row, dtype=float),
            kinds=[int(k) for k in levels.shape_kind[index]],
            hulls=[levels.vertices[index, i, : counts[i]].astype(float) for i in range(len(counts))],
            parameters=dict(zip(layout.parameters, map(float, levels.parameters[index]), strict=True)),
            key=int(key),
            tick=int(tick),
            walls=walls,
        )

    @property
    def slots(self) -> range:
        return range(len(self.types))

    def has(self, slot: int, *factors: type[Factor]) -> bool:
        """Whether the slot's entity is there and holds all these factors, or sub-classes of them."""
        kind = self.types[slot]
        return kind is not None and all(holds(kind, f) is not None for f in factors)

    def meets(self, slot: int, needs: Pattern) -> bool:
        """Whether the slot's entity can be an argument that has these needs."""
        kind = self.types[slot]
        if kind is None or not self.has(slot, *needs.factors):
            return False
        return needs.entity_type is None or issubclass(kind, needs.entity_type)

    def tuples(self, needs: tuple[Pattern, ...]) -> Iterator[tuple[int, ...]]:
        """All ordered tuples of distinct slots whose entities meet the needs, one each."""
        for slots in product(*([s for s in self.slots if self.meets(s, n)] for n in needs)):
            if len(set(slots)) == len(slots):
                yield slots

    def column(self, slot: int, factor: type[Factor]) -> int:
        """The first column of what the slot's entity holds for ``factor``."""
        kind = self.types[slot]
        held = holds(kind, factor) if kind is not None else None
        if held is None:
            raise SegarError(f"'{self.layout.names[slot]}' has no {factor.__name__}")
        return self.layout.columns[held]

    def scalar(self, slot: int, factor: type[Factor]) -> Number:
        return Number(self.values[slot, self.column(slot, factor)])

    def vector(self, slot: int, factor: type[Factor]) -> VectorValue:
        column = self.column(slot, factor)
        return VectorValue(Number(self.values[slot, column]), Number(self.values[slot, column + 1]))

    def write(self, slot: int, column: int, parts: tuple[float, ...]) -> None:
        self.values[slot, column : column + len(parts)] = parts

    def read(self, slots: tuple[int, ...], entity: int, factor: Any, wall: VectorValue | None, action: Any) -> Any:
        """What a rule receives for one hint: numbers that remember their source, text, or None for a marker."""
        if factor is Wall:
            return WallView(wall)  # type: ignore[arg-type]
        if factor is Action:
            return action
        if issubclass(factor, Parameter):
            return Number(self.parameters[factor])
        slot = slots[entity]
        if issubclass(factor, Text):
            kind = self.types[slot]
            return kind.declared.get(factor) if kind is not None else None
        if factor.width == 0:
            return None
        source = Source(entity, factor)
        if factor.width == 2:
            v = self.vector(slot, factor)
            return VectorValue(v.x, v.y, source)
        return Number.of(self.scalar(slot, factor), source)

    # -- geometry ------------------------------------------------------------------------------------------------

    def radius(self, slot: int) -> float:
        """Radius of the body's disc in contacts; for a hull, of its circumscribed disc."""
        if self.kinds[slot] == CIRCLE:
            return 0.5 * float(self.scalar(slot, Size))
        corners = self.hulls[slot]
        return float(np.linalg.norm(corners, axis=1).max()) if len(corners) else 0.0

    def overlap(self, a: int, b: int) -> bool:
        """Discs overlap when they touch; a disc overlaps a hull where its centre lies inside, edges included."""
        if not (self.has(a, Position) and self.has(b, Position)):
            return False
        apart = self.vector(a, Position) - self.vector(b, Position)
        if self.kinds[b] == HULL and self.kinds[a] != HULL:
            return bool(edge_distances(self.hulls[b], apart).min() >= 0.0)
        if self.kinds[a] == HULL and self.kinds[b] != HULL:
            return bool(edge_distances(self.hulls[a], -apart).min() >= 0.0)
        return bool(apart.norm() <= self.radius(a) + self.radius(b) + TOUCH)

    def floor_under(self, slot: int) -> int | None:
        """The floor that the thing is on: of those that it overlaps the one of lowest Order, the first of equals."""
        under = [f for f in self.slots if self.has(f, Floor, Position) and self.overlap(slot, f)]
        return min(under, key=lambda f: self.scalar(f, Order), default=None)

    def is_on(self, thing: int, ground: int) -> bool:
        """Whether ``ground`` is the floor under ``thing``; a ``ground`` without a position is under all; floors are on none."""
        if not self.has(ground, Position):
            return True
        if not self.has(thing, Position) or self.has(thing, Floor):
            return False
        return self.floor_under(thing) == ground

    def contains(self, thing: int, ground: int) -> bool:
        """Whether ``thing`` is on ``ground`` and its disc lies wholly inside the outline."""
        if not self.has(ground, Position) or not self.is_on(thing, ground):
            return False
        apart, r = self.vector(thing, Position) - self.vector(ground, Position), self.radius(thing)
        if self.kinds[ground] == HULL:
            return bool(edge_distances(self.hulls[ground], apart).min() >= r)
        return bool(apart.norm() + r <= self.radius(ground))

    def relation(self, name: str, a: int, b: int) -> bool:
        return {"is_on": self.is_on, "contains": self.contains, "overlaps": self.overlap}[name](a, b)

    @property
    def bodies(self) -> list[int]:
        """The slots whose entities take part in contacts: those that collide and have place and velocity."""
        return [s for s in self.slots if self.has(s, Collides, Position, Velocity)]


def edge_distances(hull: np.ndarray, point: VectorValue) -> np.ndarray:
    """Signed distances of a point from the lines of a counter-clockwise hull's edges, positive inside."""
    along = np.roll(hull, -1, axis=0) - hull
    inward = np.stack([-along[:, 1], along[:, 0]], axis=1) / np.linalg.norm(along, axis=1, keepdims=True)
    return ((np.array([float(point.x), float(point.y)]) - hull) * inward).sum(axis=1)
