"""What has to be drawn for levels, read off a distribution once, and the arrays that are filled by it."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from graphlib import CycleError, TopologicalSorter
from typing import Any

import numpy as np

from segar.errors import PlacementError, PriorError, did_you_mean
from segar.language import BaseShape, Entity, Factor, Layout, Order, Parameter, Position, Shape, Size, holds
from segar.levels.priors import Prior, factors_needed, factors_read, ranked
from segar.levels.sampling.placement import closest_pair
from segar.noise import Choice, Deterministic, Noise
from segar.rules import RuleSpace

RANDOM_HULL_VERTICES = 32  # room for a random hull: 100 Gaussian points have 8.8 +- 1.5 vertices on their hull


@dataclass(frozen=True)
class SlotGroup:
    """Slots that one entry of ``numbers`` fills: how many are filled, and by which types with which probabilities."""

    slots: tuple[int, ...]
    count: Noise | int
    types: tuple[int, ...]
    probabilities: tuple[float, ...]


@dataclass(frozen=True)
class Draw:
    """A factor of one slot that is drawn where the slot's entity has one of ``types``; priors most specific first."""

    slot: int
    factor: type[Factor]
    types: tuple[int, ...]
    priors: tuple[Prior, ...]


@dataclass(frozen=True)
class Outline:
    """The shape, or the choice of shapes, of one slot's entities of ``types``."""

    slot: int
    shapes: BaseShape | Choice
    size_is_drawn: bool
    types: tuple[int, ...]

    @cached_property
    def choice(self) -> Choice:
        """The choice of shapes; one among one where the shape is given."""
        return self.shapes if isinstance(self.shapes, Choice) else Choice([self.shapes])

    @property
    def is_random(self) -> bool:
        """Whether the shape is chosen or drawn level by level."""
        return isinstance(self.shapes, Choice) or self.shapes.is_random


@dataclass(frozen=True)
class SamplingPlan:
    """All that sampling needs of a distribution.

    Attributes:
        templates: float64 ``(types + 1, width)``: the constant factors of each entity type; the last row is all nan.
        parameters: float64, the constant world parameters in the layout's order.
        parameter_priors: column of a parameter and the prior that it is drawn from.
        fixed_positions: slot to the place where its entity always starts.
        vertices: room for the vertices of one thing.
        rule_space: draws the rules of each level; None where all have the same.
    """

    layout: Layout
    groups: tuple[SlotGroup, ...]
    templates: np.ndarray
    draws: tuple[Draw, ...]
    outlines: tuple[Outline, ...]
    fixed_positions: Mapping[int, tuple[float, float]]
    parameters: np.ndarray
    parameter_priors: tuple[tuple[int, Prior], ...]
    min_distance: float
    vertices: int
    rule_space: RuleSpace | None = None

    @property
    def rule_columns(self) -> list[int]:
        """Columns of the parameters that the rule space draws."""
        drawn = () if self.rule_space is None else self.rule_space.parameters
        return list(map(self.layout.parameters.index, drawn))

    def constant(self, kind: int, factor: type[Factor]) -> Deterministic:
        """The value that the factor of entities of type ``kind`` has where no prior draws it."""
        value = self.templates[kind, self.layout.columns_of(factor)].tolist()
        return Deterministic(value if factor.width == 2 else value[0])

    def law(self, slot: int, factor: type[Factor], kind: int) -> Noise | Draw:
        """The distribution of a factor of one slot's entities of type ``kind``, or the draw if it depends on other factors."""
        if factor is Position and slot in self.fixed_positions:
            return Deterministic(self.fixed_positions[slot])
        draw = next((d for d in self.draws if d.slot == slot and d.factor is factor and kind in d.types), None)
        if draw is None:
            return self.constant(kind, factor)
        simple = isinstance(draw.priors[0].value, Noise) and not factors_needed(draw.priors[0])
        return draw.priors[0].value if simple else draw

    def outline_of(self, slot: int, kind: int) -> Outline | None:
        """The outline of one slot's entities of type ``kind``, None where they have no shape."""
        return next((o for o in self.outlines if o.slot == slot and kind in o.types), None)

    def size_follows_shape(self, slot: int, kind: int) -> bool:
        """Whether the size of one slot's entities of type ``kind`` is that of the shape that is chosen for them."""
        outline = self.outline_of(slot, kind)
        return outline is not None and isinstance(outline.shapes, Choice) and not outline.size_is_drawn


def make_sampling_plan(
    layout: Layout,
    groups: Sequence[SlotGroup],
    priors: Sequence[Prior],
    parameters: Mapping[type[Parameter], Prior],
    fixed_positions: Mapping[int, tuple[float, float]],
    min_distance: float,
    rule_space: RuleSpace | None = None,
) -> SamplingPlan:
    """Resolve priors for every slot and entity type.

    Raises:
        PriorError: priors contradict each other or read what is not drawn yet.
        PlacementError: things that always start at fixed places are too close to each other.
    """
    templates = np.full((len(layout.types) + 1, layout.width), np.nan)
    for place, entity in enumerate(layout.types[:-1]):
        templates[place] = _template(layout, entity, priors)
    templates[-2] = _template(layout, layout.types[-1], ())  # the arena's floor, whose friction is a parameter
    outlines = _outlines(layout, priors)
    constants = [parameters[p].value if p in parameters else p.default for p in layout.parameters]
    plan = SamplingPlan(
        layout,
        tuple(groups),
        templates,
        _in_order(layout, _draws(layout, groups, priors)),
        outlines,
        fixed_positions,
        np.array([p.default if isinstance(v, Noise) else v for p, v in zip(layout.parameters, constants, strict=True)]),
        tuple((layout.parameters.index(p), prior) for p, prior in parameters.items() if prior.is_random),
        min_distance,
        max((_vertex_room(shape) for o in outlines for shape in o.choice.keys), default=0),
        rule_space,
    )
    _check_constant_places(plan)
    return plan


def _vertex_room(shape: BaseShape) -> int:
    """How many vertices the shape can have: 0 for a circle; a random shape may say so as ``max_vertices``."""
    if shape.is_random:
        return getattr(shape, "max_vertices", RANDOM_HULL_VERTICES)
    return len(shape.vertices)


def _template(layout: Layout, entity: type[Entity], priors: Sequence[Prior]) -> np.ndarray:
    row = np.full(layout.width, np.nan)
    defaults = entity().factors
    for factor in layout.factors:
        if factor not in entity.declared:
            continue
        value = defaults[factor]
        candidates = ranked(priors, entity, factor)
        setting = candidates[-1] if candidates and not factors_read(candidates[-1]) else None
        if setting is not None and not setting.is_random:
            value = setting.value
        elif setting is None and factor is Size and isinstance(shape := _shape(entity, priors), BaseShape):
            value = shape.size
        row[layout.columns_of(factor)] = value
    return row


def _draws(layout: Layout, groups: Sequence[SlotGroup], priors: Sequence[Prior]) -> list[Draw]:
    draws = []
    for group in groups:
        alike: dict[tuple[type[Factor], tuple[int, ...]], tuple[tuple[Prior, ...], list[int]]] = {}
        for place in group.types:
            entity = layout.types[place]
            for factor in (f for f in entity.declared if f.width):
                found = ranked(priors, entity, factor)
                if any(p.is_random or factors_read(p) for p in found):
                    _check_reads(layout, entity, found, priors)
                    _, places = alike.setdefault((factor, tuple(map(id, found))), (found, []))
                    places.append(place)
        for slot in group.slots:
            for (factor, _), (found, places) in alike.items():
                draws.append(Draw(slot, factor, tuple(places), found))
    return draws


def _check_reads(layout: Layout, entity: type[Entity], candidates: Sequence[Prior], priors: Sequence[Prior]) -> None:
    """Raise :class:`PriorError` if a distribution depends on factors that its entity lacks, or that are known too late."""
    for prior in candidates:
        in_relation = factors_read(prior)
        for name, factor in factors_needed(prior):
            for owner in (entity,) if name is None else _types_of(layout, name, prior):
                held = holds(owner, factor)
                if held is None and (name is not None or factor not in in_relation):
                    advice = "" if name else "; give the prior an entity_type that has it"
                    raise PriorError(
                        f"{prior}: its distribution reads {factor.__name__}, which {owner.__name__} lacks{advice}"
                    )
                if held is Size and not ranked(priors, owner, Size) and isinstance(_shape(owner, priors), Choice):
                    raise PriorError(
                        f"{prior} reads Size, which for {owner.__name__} is that of a shape that is chosen later; give"
                        " Size a prior of its own"
                    )


def _types_of(layout: Layout, name: str, prior: Prior) -> tuple[type[Entity], ...]:
    """The types that the entity of that name may have; raises :class:`PriorError` if it may be absent."""
    if name not in layout.names:
        raise PriorError(f"{prior}: there is no entity '{name}'.{did_you_mean(name, layout.names)}")
    slot = layout.slots[layout.names.index(name)]
    if slot.optional:
        raise PriorError(f"{prior}: its distribution reads '{name}', which not every level has")
    return slot.types


def _in_order(layout: Layout, draws: list[Draw]) -> tuple[Draw, ...]:
    """The draws such that what a conditional prior reads is drawn before it."""
    graph: dict[tuple[int, type[Factor]], set[tuple[int, type[Factor]]]] = {(d.slot, d.factor): set() for d in draws}
    for draw in draws:
        for prior in draw.priors:
            for name, read in factors_needed(prior):
                if issubclass(read, (Position, Order)):
                    what = "relation" if read in factors_read(prior) else "distribution"
                    raise PriorError(f"{prior}: its {what} reads {read.__name__}, which is drawn last")
                slot = draw.slot if name is None else layout.names.index(name)
                graph[draw.slot, draw.factor] |= {
                    node for node in graph if node[0] == slot and issubclass(node[1], read)
                }
    try:
        order = list(TopologicalSorter(graph).static_order())
    except CycleError as error:
        nodes = error.args[1]
        several = len({slot for slot, _ in nodes}) > 1
        names = " -> ".join((f"{layout.names[s]}." if several else "") + f.__name__ for s, f in nodes)
        raise PriorError(f"conditional priors need each other's factors: {names}") from None
    return tuple(sorted(draws, key=lambda draw: order.index((draw.slot, draw.factor))))


def _outlines(layout: Layout, priors: Sequence[Prior]) -> tuple[Outline, ...]:
    outlines = []
    for slot, place in enumerate(layout.slots):
        alike: dict[Any, list[int]] = {}
        for entity in place.types:
            shape = _shape(entity, priors)
            if shape is None:
                continue
            size_is_drawn = Size in entity.declared and bool(ranked(priors, entity, Size))
            alike.setdefault((shape, size_is_drawn), []).append(layout.types.index(entity))
        outlines += [Outline(slot, shape, drawn, tuple(types)) for (shape, drawn), types in alike.items()]
    return tuple(outlines)


def _shape(entity: type[Entity], priors: Sequence[Prior]) -> BaseShape | Choice | None:
    if Shape not in entity.declared:
        return None
    candidates = ranked(priors, entity, Shape)
    conditional = next((p for p in candidates if factors_read(p)), None)
    if conditional is not None:
        raise PriorError(f"{conditional}: the relation of a prior on Shape may read only Label and ID")
    return candidates[0].value if candidates else entity.declared[Shape]


def _check_constant_places(plan: SamplingPlan) -> None:
    """Raise :class:`PlacementError` if two things that are always there always start too close to each other."""
    if Position not in plan.layout.columns:
        return
    drawn = {draw.slot for draw in plan.draws if issubclass(draw.factor, Position)}
    places = np.full((len(plan.layout.slots), 2), np.nan)
    for group in plan.groups:
        for slot in group.slots:
            options = np.unique(plan.templates[list(group.types), plan.layout.columns_of(Position)], axis=0)
            if slot in plan.fixed_positions:
                places[slot] = plan.fixed_positions[slot]
            elif slot not in drawn and len(options) == 1 and not plan.layout.slots[slot].optional:
                places[slot] = options[0]
    i, j, distance = closest_pair(places)
    if distance <= plan.min_distance:
        a, b = plan.layout.names[i], plan.layout.names[j]
        raise PlacementError(
            f"'{a}' and '{b}' always start {distance:.3g} apart, and centres must be more than {plan.min_distance:g}"
            " apart; give one of them a prior on Position, or another place"
        )
