"""The state of one environment as the interpreter reads and writes it, its geometry, and the result of a step."""

from collections.abc import Iterator
from dataclasses import dataclass, field
from functools import lru_cache
from itertools import product
from typing import Any, Self

import numpy as np

from segar import language
from segar.errors import SegarError
from segar.levels import Levels

TOUCH = 1e-7  # [m] closer than this counts as touching; 2022 uses the same

holds = lru_cache(maxsize=4096)(language.holds)


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

    layout: language.Layout
    types: list[type[language.Entity] | None]
    values: np.ndarray
    kinds: list[int]
    hulls: list[np.ndarray]
    parameters: dict[type[language.Parameter], float]
    key: int
    tick: int
    walls: float

    @classmethod
    def of_level(cls, levels: Levels, index: int, values: np.ndarray | None, key: int, tick: int, walls: float) -> Self:
        """The initial state of a level, or ``values`` in it (float64 ``(entities, columns)``, copied)."""
        layout, row = levels.layout, levels.values[index] if values is None else np.asarray(values)
        if row.shape != levels.values.shape[1:]:
            raise SegarError(f"the state of a level has the shape {levels.values.shape[1:]}, not {row.shape}")
        names: list[type[language.Entity] | None] = [*layout.types, None]
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

    def has(self, slot: int, *factors: type[language.Factor]) -> bool:
        """Whether the slot's entity is there and holds all these factors, or sub-classes of them."""
        kind = self.types[slot]
        return kind is not None and all(holds(kind, f) is not None for f in factors)

    def meets(self, slot: int, needs: language.Pattern) -> bool:
        """Whether the slot's entity can be an argument that has these needs."""
        kind = self.types[slot]
        if kind is None or not self.has(slot, *needs.factors):
            return False
        return needs.entity_type is None or issubclass(kind, needs.entity_type)

    def tuples(self, needs: tuple[language.Pattern, ...]) -> Iterator[tuple[int, ...]]:
        """All ordered tuples of distinct slots whose entities meet the needs, one each."""
        for slots in product(*([s for s in self.slots if self.meets(s, n)] for n in needs)):
            if len(set(slots)) == len(slots):
                yield slots

    def column(self, slot: int, factor: type[language.Factor]) -> int:
        """The first column of what the slot's entity holds for ``factor``."""
        kind = self.types[slot]
        held = holds(kind, factor) if kind is not None else None
        if held is None:
            raise SegarError(f"'{self.layout.names[slot]}' has no {factor.__name__}")
        return self.layout.columns[held]

    def scalar(self, slot: int, factor: type[language.Factor]) -> language.Number:
        return language.Number(self.values[slot, self.column(slot, factor)])

    def vector(self, slot: int, factor: type[language.Factor]) -> language.VectorValue:
        column = self.column(slot, factor)
        return language.VectorValue(
            language.Number(self.values[slot, column]), language.Number(self.values[slot, column + 1])
        )

    def write(self, slot: int, column: int, parts: tuple[float, ...]) -> None:
        self.values[slot, column : column + len(parts)] = parts

    def read(
        self, slots: tuple[int, ...], entity: int, factor: Any, wall: language.VectorValue | None, action: Any
    ) -> Any:
        """What a rule receives for one hint: numbers that remember their source, text, or None for a marker."""
        if factor is language.Wall:
            return language.WallView(wall)  # type: ignore[arg-type]
        if factor is language.Action:
            return action
        if issubclass(factor, language.Parameter):
            return language.Number(self.parameters[factor])
        slot = slots[entity]
        if issubclass(factor, language.Text):
            kind = self.types[slot]
            return kind.declared.get(factor) if kind is not None else None
        if factor.width == 0:
            return None
        source = language.Source(entity, factor)
        if factor.width == 2:
            v = self.vector(slot, factor)
            return language.VectorValue(v.x, v.y, source)
        return language.Number.of(self.scalar(slot, factor), source)

    # -- geometry ------------------------------------------------------------------------------------------------

    def radius(self, slot: int) -> float:
        """Radius of the body's disc in contacts; for a hull, of its circumscribed disc."""
        if self.kinds[slot] == language.CIRCLE:
            return 0.5 * float(self.scalar(slot, language.Size))
        corners = self.hulls[slot]
        return float(np.linalg.norm(corners, axis=1).max()) if len(corners) else 0.0

    def overlap(self, a: int, b: int) -> bool:
        """Discs overlap when they touch; a disc overlaps a hull where its centre lies inside, edges included."""
        if not (self.has(a, language.Position) and self.has(b, language.Position)):
            return False
        apart = self.vector(a, language.Position) - self.vector(b, language.Position)
        if self.kinds[b] == language.HULL and self.kinds[a] != language.HULL:
            return bool(edge_distances(self.hulls[b], apart).min() >= 0.0)
        if self.kinds[a] == language.HULL and self.kinds[b] != language.HULL:
            return bool(edge_distances(self.hulls[a], -apart).min() >= 0.0)
        return bool(apart.norm() <= self.radius(a) + self.radius(b) + TOUCH)

    def is_on(self, thing: int, ground: int) -> bool:
        """Whether ``ground`` is the floor under ``thing``: of those that it overlaps the first of lowest Order.

        A ``ground`` without a position is under all; floors are on none.
        """
        if not self.has(ground, language.Position):
            return True
        if not self.has(thing, language.Position) or self.has(thing, language.Floor):
            return False
        under = [f for f in self.slots if self.has(f, language.Floor, language.Position) and self.overlap(thing, f)]
        return min(under, key=lambda f: self.scalar(f, language.Order), default=None) == ground

    def contains(self, thing: int, ground: int) -> bool:
        """Whether ``thing`` is on ``ground`` and its disc lies wholly inside the outline."""
        if not self.has(ground, language.Position) or not self.is_on(thing, ground):
            return False
        apart, r = self.vector(thing, language.Position) - self.vector(ground, language.Position), self.radius(thing)
        if self.kinds[ground] == language.HULL:
            return bool(edge_distances(self.hulls[ground], apart).min() >= r)
        return bool(apart.norm() + r <= self.radius(ground))

    def relation(self, name: str, a: int, b: int) -> bool:
        return {"is_on": self.is_on, "contains": self.contains, "overlaps": self.overlap}[name](a, b)

    @property
    def bodies(self) -> list[int]:
        """The slots whose entities take part in contacts: those that collide and have place and velocity."""
        return [s for s in self.slots if self.has(s, language.Collides, language.Position, language.Velocity)]


def edge_distances(hull: np.ndarray, point: language.VectorValue) -> np.ndarray:
    """Signed distances of a point from the lines of a counter-clockwise hull's edges, positive inside."""
    along = np.roll(hull, -1, axis=0) - hull
    inward = np.stack([-along[:, 1], along[:, 0]], axis=1) / np.linalg.norm(along, axis=1, keepdims=True)
    return ((np.array([float(point.x), float(point.y)]) - hull) * inward).sum(axis=1)


@dataclass(frozen=True)
class Firing:
    """A rule that had effects: in which stage, on which entities (by name), and which effects."""

    stage: str
    rule: language.Rule
    entities: tuple[str, ...]
    effects: tuple[language.Effect, ...]

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

    def read(self, entity: str, factor: type[language.Factor]) -> Any:
        """The factor of the entity of that name: a float, or two for a vector.

        Raises:
            SegarError: there is no such entity, or it has no such factor.
        """
        slot = self.state.layout.slot_index(entity)
        column = self.state.column(slot, factor)
        part = tuple(map(float, self.values[slot, column : column + factor.width]))
        return part[0] if len(part) == 1 else part
