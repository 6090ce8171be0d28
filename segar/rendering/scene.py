"""The things of one environment as people see them, read from its state: places, colours and factors, no pictures."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from segar.language import (
    CIRCLE,
    HULL,
    Alive,
    Charge,
    Consumes,
    Done,
    Entity,
    Factor,
    Floor,
    Friction,
    Heat,
    Layout,
    Magnetism,
    Mass,
    Mobile,
    Order,
    Pattern,
    Position,
    Size,
    Slot,
    StoredEnergy,
    Task,
    Text,
    Velocity,
    Visible,
    WorldRules,
    entity_name,
    holds,
)
from segar.levels import Levels
from segar.observations import COLOURS, RGB, Colour, colour_of

# In letters as physics has them, with the value that goes without saying.
SYMBOLS: Mapping[type[Factor], tuple[str, float]] = {
    Charge: ("q", 0.0),
    Magnetism: ("B", 0.0),
    StoredEnergy: ("E", 0.0),
    Mass: ("m", 1.0),
    Friction: ("µ", 0.0),
    Heat: ("heat", 0.0),
}
NUMBERS = {
    "charge": Charge,
    "magnetism": Magnetism,
    "energy": StoredEnergy,
    "friction": Friction,
    "heat": Heat,
}
BUILT_IN = "segar.language.factors"


@dataclass(frozen=True)
class Figure:
    """One thing as people see it.

    Attributes:
        name: of the entity; ``note``: its factors in short.
        entity: its type.
        place: float64 ``(2,)`` [m].
        radius: of a circle, else of the smallest one around the place that holds the outline [m].
        corners: of a hull, float64 ``(k, 2)`` [m]; empty for a circle.
        colour: as in pixel observations.
        velocity: float64 ``(2,)`` [m/s].
        charge, magnetism, energy, friction, heat: 0 where the entity lacks the factor.
        is_agent: whether actions move it.
    """

    name: str
    note: str
    entity: type[Entity]
    place: np.ndarray
    radius: float
    corners: np.ndarray
    colour: RGB
    velocity: np.ndarray
    order: float
    charge: float
    magnetism: float
    energy: float
    friction: float
    heat: float
    is_tile: bool
    is_hole: bool
    is_agent: bool
    is_mobile: bool
    is_visible: bool
    is_alive: bool
    is_done: bool


@dataclass(frozen=True)
class Scene:
    """One environment at one moment: figures from the lowest to the highest, and the text below them.

    ``has_charges`` and ``has_magnets`` say whether rules of the world listen to them.
    """

    figures: tuple[Figure, ...]
    walls: float
    has_charges: bool
    has_magnets: bool
    line: str = ""


@dataclass(frozen=True, eq=False)
class Stage:
    """Levels with their rules and task, which are needed to read the things of a state.

    ``colours`` maps entity types to colours, beside the built-in ones.
    """

    levels: Levels
    world: WorldRules
    task: Task
    colours: Mapping[type[Entity], Colour] = field(default_factory=dict)

    def scene(self, values: np.ndarray, level: int, line: str = "") -> Scene:
        """The scene of one environment: its state, float64 ``[entity, column]``, the index of its level, and a text."""
        levels = self.levels
        shaped = np.flatnonzero((levels.types[level] >= 0) & np.isin(levels.shape_kind[level], (CIRCLE, HULL)))
        found = [_figure(self, level, int(slot), values[slot]) for slot in shaped]
        # Among tiles the lowest Order lies on top, among objects the highest, as in pixel observations.
        tiles = sorted((f for f in found if f and f.is_tile), key=lambda f: -f.order)
        objects = sorted((f for f in found if f and not f.is_tile), key=lambda f: f.order)
        return Scene((*tiles, *objects), self.world.walls, self._has_charges, self._has_magnets, line)

    @cached_property
    def agents(self) -> frozenset[int]:
        """The slots that the task's actions reach."""
        reached = [rule.signature.entities for rule in self.task.functions().act if rule.signature.uses("action")]
        slots = enumerate(self.levels.layout.slots)
        return frozenset(k for k, slot in slots if any(_may_match(slot, p) for patterns in reached for p in patterns))

    @cached_property
    def palette(self) -> Mapping[type[Entity], Colour]:
        return {**COLOURS, **self.colours}

    @cached_property
    def _has_charges(self) -> bool:
        return _listens(self.world, Charge)

    @cached_property
    def _has_magnets(self) -> bool:
        return _listens(self.world, Magnetism)


def _may_match(slot: Slot, pattern: Pattern) -> bool:
    if pattern.entity_type is not None:
        return any(issubclass(t, pattern.entity_type) for t in slot.types)
    return all(slot.may_have(factor) for factor in pattern.factors)


def _listens(world: WorldRules, factor: type[Factor]) -> bool:
    """Whether some rule asks for the factor."""
    return any(factor in pattern.factors for rule in world.rules for pattern in rule.signature.entities)


def _figure(stage: Stage, level: int, slot: int, row: np.ndarray) -> Figure | None:
    """The figure of one entity; None where it has no finite place or size."""
    levels, layout = stage.levels, stage.levels.layout
    entity = layout.types[levels.types[level, slot]]

    def read(factor: type[Factor], default: float = 0.0) -> float:
        held = holds(entity, factor)
        return float(row[layout.columns[held]]) if held is not None else default

    def read_vector(factor: type[Factor]) -> np.ndarray:
        held = holds(entity, factor)
        return row[layout.columns[held] :][:2].copy() if held is not None else np.zeros(2)

    place, corners, radius = read_vector(Position), np.zeros((0, 2)), read(Size) / 2
    if levels.shape_kind[level, slot] == HULL:
        relative = levels.vertices[level, slot, : levels.vertex_count[level, slot]]
        corners, radius = place + relative, float(np.sqrt((relative**2).sum(axis=1)).max())
    if holds(entity, Position) is None or not np.isfinite([*place, radius]).all() or radius <= 0:
        return None
    colour = colour_of(entity, stage.palette)
    tint = read(colour.factor) if colour.factor is not None else 0.0
    return Figure(
        name=_name(layout.slots[slot], entity),
        note=_note(entity, layout, row),
        entity=entity,
        place=place,
        radius=radius,
        corners=corners,
        colour=_blend(colour, tint),
        velocity=np.nan_to_num(read_vector(Velocity)),
        order=read(Order),
        **{name: float(np.nan_to_num(read(factor))) for name, factor in NUMBERS.items()},
        is_tile=Floor in entity.declared,
        is_hole=Consumes in entity.declared,
        is_agent=slot in stage.agents,
        is_mobile=read(Mobile) > 0,
        is_visible=read(Visible, 1.0) > 0,
        is_alive=read(Alive, 1.0) > 0,
        is_done=read(Done) > 0,
    )


def _name(slot: Slot, entity: type[Entity]) -> str:
    """What it is; with the slot's name where that says something else, such as which of several it is."""
    kind = entity_name(entity)
    return slot.name if slot.name.startswith(kind) or len(slot.types) == 1 else kind


def _note(entity: type[Entity], layout: Layout, row: np.ndarray) -> str:
    """Factors that are not what they usually are, and all numbers that are the user's own."""
    words = []
    for factor in entity.declared:
        if factor.width != 1:
            continue
        value = float(row[layout.columns[factor]])
        known = next((s for f, s in SYMBOLS.items() if issubclass(factor, f)), None)
        if known is not None and abs(value - known[1]) >= 0.005:
            words.append(f"{known[0]} {_number(value, signed=known[0] in 'qBE')}")
        elif known is None and factor.__module__ != BUILT_IN and not issubclass(factor, Text):
            words.append(f"{factor.__name__} {_number(value)}")
    return "  ".join(words)


def _number(value: float, signed: bool = False) -> str:
    text = f"{value:+.2f}" if signed else f"{value:.4g}" if abs(value) >= 100 else f"{value:.2f}"
    return text.replace("-", "−")


def _blend(colour: Colour, value: float) -> RGB:
    low, high = np.array(colour.low), np.array(colour.high or colour.low)
    share = np.clip((np.nan_to_num(value) - colour.span[0]) / (colour.span[1] - colour.span[0]), 0.0, 1.0)
    red, green, blue = np.rint(low + share * (high - low)).astype(int)
    return int(red), int(green), int(blue)
