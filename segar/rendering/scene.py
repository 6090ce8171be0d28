"""What people see of one environment: size and hints of the picture; the things, read from the state: places, colours and
factors; and the field that the arrows of a picture follow. No pictures."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from segar import language
from segar.errors import SegarError
from segar.levels import Levels
from segar.observations import COLOURS, RGB, Colour, colour_of

SMALLEST, LARGEST = 64, 2048  # [px]
READABLE = 192  # [px] smaller pictures have no room for text
LINE_SHARE = 16  # the arena is so many times as high as the line below it


@dataclass(frozen=True)
class View:
    """How an environment is drawn for people.

    Args:
        size: side of the arena in pixels, an even number from 64 to 2048.
        labels: whether things have their names and factors written beside them, in pictures of at least 192 pixels.
        fields: whether faint arrows show where charges push and what magnets turn.
        line: whether there is a line of text below the arena, of at least 192 pixels: step, return, level.
        colours: entity type to its colour, as :class:`segar.observations.Pixels` takes them.

    Raises:
        SegarError: the size is not one of these.
    """

    size: int = 512
    labels: bool = True
    fields: bool = True
    line: bool = True
    colours: Mapping[type[language.Entity], Colour] = field(default_factory=dict, hash=False)

    def __post_init__(self) -> None:
        if self.size % 2 or not SMALLEST <= self.size <= LARGEST:  # video codecs take even sizes
            raise SegarError(f"View: size must be an even number from {SMALLEST} to {LARGEST}, not {self.size!r}")

    @property
    def line_height(self) -> int:
        """Height of the line below the arena [px], an even number."""
        return 2 * (max(self.size // LINE_SHARE, 20) // 2) if self.line and self.is_readable else 0

    @property
    def is_readable(self) -> bool:
        """Whether text has room."""
        return self.size >= READABLE

    @property
    def shape(self) -> tuple[int, int, int]:
        """Shape of a frame: rows, columns, colours."""
        return self.size + self.line_height, self.size, 3


# In letters as physics has them, with the value that goes without saying.
SYMBOLS: Mapping[type[language.Factor], tuple[str, float]] = {
    language.Charge: ("q", 0.0),
    language.Magnetism: ("B", 0.0),
    language.StoredEnergy: ("E", 0.0),
    language.Mass: ("m", 1.0),
    language.Friction: ("µ", 0.0),
    language.Heat: ("heat", 0.0),
}
NUMBERS = {
    "charge": language.Charge,
    "magnetism": language.Magnetism,
    "energy": language.StoredEnergy,
    "friction": language.Friction,
    "heat": language.Heat,
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
    entity: type[language.Entity]
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
    world: language.WorldRules
    task: language.Task
    colours: Mapping[type[language.Entity], Colour] = field(default_factory=dict)

    def scene(self, values: np.ndarray, level: int, line: str = "") -> Scene:
        """The scene of one environment: its state, float64 ``[entity, column]``, the index of its level, and a text."""
        levels = self.levels
        shaped = np.flatnonzero(
            (levels.types[level] >= 0) & np.isin(levels.shape_kind[level], (language.CIRCLE, language.HULL))
        )
        found = [_figure(self, level, int(slot), values[slot]) for slot in shaped]
        # Among tiles the lowest Order lies on top, among objects the highest, as in pixel observations.
        tiles = sorted((f for f in found if f and f.is_tile), key=lambda f: -f.order)
        objects = sorted((f for f in found if f and not f.is_tile), key=lambda f: f.order)
        asked = {f for rule in self.world.rules for pattern in rule.signature.entities for f in pattern.factors}
        charges, magnets = (factor in asked for factor in (language.Charge, language.Magnetism))
        return Scene((*tiles, *objects), self.world.walls, charges, magnets, line)

    @cached_property
    def agents(self) -> frozenset[int]:
        """The slots that the task's actions reach."""
        acts = [rule.signature for rule in self.task.functions().act if rule.signature.uses("action")]
        reached = [pattern for signature in acts for pattern in signature.entities]
        slots = enumerate(self.levels.layout.slots)
        return frozenset(k for k, slot in slots for t in slot.types if any(language.matches(t, p) for p in reached))

    @cached_property
    def palette(self) -> Mapping[type[language.Entity], Colour]:
        return {**COLOURS, **self.colours}


def _figure(stage: Stage, level: int, slot: int, row: np.ndarray) -> Figure | None:
    """The figure of one entity; None where it has no finite place or size."""
    levels, layout = stage.levels, stage.levels.layout
    entity = layout.types[levels.types[level, slot]]

    def read(factor: type[language.Factor], default: float = 0.0) -> float:
        held = language.holds(entity, factor)
        return float(row[layout.columns[held]]) if held is not None else default

    def read_vector(factor: type[language.Factor]) -> np.ndarray:
        held = language.holds(entity, factor)
        return row[layout.columns[held] :][:2].copy() if held is not None else np.zeros(2)

    place, corners, radius = read_vector(language.Position), np.zeros((0, 2)), read(language.Size) / 2
    if levels.shape_kind[level, slot] == language.HULL:
        relative = levels.vertices[level, slot, : levels.vertex_count[level, slot]]
        corners, radius = place + relative, float(np.sqrt((relative**2).sum(axis=1)).max())
    if language.holds(entity, language.Position) is None or not np.isfinite([*place, radius]).all() or radius <= 0:
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
        velocity=np.nan_to_num(read_vector(language.Velocity)),
        order=read(language.Order),
        **{name: float(np.nan_to_num(read(factor))) for name, factor in NUMBERS.items()},
        is_tile=language.Floor in entity.declared,
        is_hole=language.Consumes in entity.declared,
        is_agent=slot in stage.agents,
        is_mobile=read(language.Mobile) > 0,
        is_visible=read(language.Visible, 1.0) > 0,
        is_alive=read(language.Alive, 1.0) > 0,
        is_done=read(language.Done) > 0,
    )


def _name(slot: language.Slot, entity: type[language.Entity]) -> str:
    """What it is; with the slot's name where that says something else, such as which of several it is."""
    kind = language.entity_name(entity)
    return slot.name if slot.name.startswith(kind) or len(slot.types) == 1 else kind


def _note(entity: type[language.Entity], layout: language.Layout, row: np.ndarray) -> str:
    """Factors that are not what they usually are, and all numbers that are the user's own."""
    words = []
    for factor in entity.declared:
        if factor.width != 1:
            continue
        value = float(row[layout.columns[factor]])
        known = next((s for f, s in SYMBOLS.items() if issubclass(factor, f)), None)
        if known is not None and abs(value - known[1]) >= 0.005:
            words.append(f"{known[0]} {_number(value, signed=known[0] in 'qBE')}")
        elif known is None and factor.__module__ != BUILT_IN and not issubclass(factor, language.Text):
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


FAINT, STRONG = 0.3, 10.0  # [1/m^2] fields at which a hint begins to show, and at which it does not grow any more


def electric_field(sources: Sequence[Figure], points: np.ndarray) -> np.ndarray:
    """The sum of q r / |r|^3 over the sources: the force on a unit charge, as in :func:`segar.lorentz_law`.

    Args:
        points: float64 ``(n, 2)`` [m].

    Returns:
        float64 ``(n, 2)`` [1/m^2].
    """
    field = np.zeros_like(points)
    for source in sources:
        away = points - source.place
        distance = np.maximum(np.sqrt((away**2).sum(axis=1)), 1e-6)  # [m] nowhere infinite
        field += source.charge * away / distance[:, None] ** 3
    return field


def hint_strength(field: np.ndarray) -> np.ndarray:
    """How strongly to hint at a field, float64 ``(n,)`` from 0 to 1, by the logarithm of its length."""
    length = np.maximum(np.sqrt((field**2).sum(axis=1)), 1e-12)
    return np.clip(np.log(length / FAINT) / np.log(STRONG / FAINT), 0.0, 1.0)


def charge_sources(figures: Sequence[Figure]) -> list[Figure]:
    """The charges that hints are drawn for: all but the agent's, which feels the field."""
    return [f for f in figures if f.charge != 0 and not f.is_agent and f.is_alive and not f.is_done]
