"""Levels from entities that are given one by one."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from segar.errors import LevelError
from segar.language import ID, Entity, GlobalFriction, Label, Layout, Parameter, Shape, Slot, entity_name, name_slots
from segar.levels.level_data import LevelData, Provenance, layout_on_floor
from segar.rules import World
from segar.support import __version__


def levels_of_entities(
    levels: Sequence[Sequence[Entity]],
    parameters: Mapping[type[Parameter], Any],
    world: World | None,
    name: str | None,
) -> LevelData:
    """The levels that these entities make; see :meth:`segar.Levels.from_entities`."""
    _check_entities(levels)
    for parameter in parameters:
        if not (isinstance(parameter, type) and issubclass(parameter, Parameter)):
            raise LevelError(f"parameters: {parameter!r} is not a world parameter class such as Gravity")
    layout = _layout(levels, parameters)
    shapes = [entity[Shape] for entities in levels for entity in entities if Shape in entity]
    room = max((len(shape.vertices) for shape in shapes), default=0)
    origin = Provenance(name, "", __version__, 0, "", np.arange(len(levels)))
    block = LevelData.empty(room, layout, origin, world=world)
    for i, entities in enumerate(levels):
        for k, entity in enumerate(entities):
            block.types[i, k] = layout.types.index(type(entity))
            for factor in layout.columns:
                if factor in entity:
                    block.values[i, k, layout.columns_of(factor)] = entity[factor]
            if Shape in entity:
                block.set_shape(i, k, entity[Shape])
    _set_parameters(block.parameters, layout, parameters)
    block.types[:, -1] = layout.types.index(GlobalFriction)
    layout.set_floor(block.values, block.parameters)
    block.sampled_values[:] = block.values
    return block


def _check_entities(levels: Sequence[Sequence[Entity]]) -> None:
    if not len(levels) or not all(hasattr(entities, "__len__") and len(entities) for entities in levels):
        raise LevelError("from_entities: give at least one level, each a list of at least one entity: [[GolfBall()]]")
    for i, entities in enumerate(levels):
        for entity in entities:
            where = f"level {i}: {entity!r}"
            if not isinstance(entity, Entity):
                raise LevelError(f"{where} is not an entity; write for instance GolfBall({{Position: [0, 0]}})")
            if type(entity) is Entity:
                raise LevelError(f"{where} has no type of its own; declare a sub-class of Entity with these factors")
            if isinstance(entity, GlobalFriction):
                raise LevelError(f"{where}: every level has the floor already; give parameters={{FloorFriction: ...}}")
            if Label in entity and entity[Label] != type(entity).declared[Label]:
                raise LevelError(
                    f"{where}: the label belongs to the type; declare a sub-class with label {entity[Label]!r}"
                )
            if Shape in entity and entity[Shape].is_random:
                raise LevelError(f"{where}: a random shape needs a distribution; give a ConvexHull of its points")


def _layout(levels: Sequence[Sequence[Entity]], parameters: Mapping[type[Parameter], Any]) -> Layout:
    most = max(map(len, levels))
    columns = [[entities[k] for entities in levels if len(entities) > k] for k in range(most)]
    types = [tuple(dict.fromkeys(type(entity) for entity in column)) for column in columns]
    names = name_slots([(t, 1) for t in types])
    for k, column in enumerate(columns):
        ids = {entity.factors.get(ID, "") for entity in column}
        own = next(iter(ids))
        if len(ids) == 1 and own and own != entity_name(type(column[0])):
            names[k] = own
    doubles = sorted({name for name in names if names.count(name) > 1})
    if doubles:
        raise LevelError(f"several entities are called '{doubles[0]}'; give each its own ID")
    slots = [Slot(name, t, len(c) < len(levels)) for name, t, c in zip(names, types, columns, strict=True)]
    return layout_on_floor(slots, parameters)


def _set_parameters(table: np.ndarray, layout: Layout, given: Mapping[type[Parameter], Any]) -> None:
    for column, parameter in enumerate(layout.parameters):
        value = np.asarray(given.get(parameter, parameter.default), dtype=float)
        n = len(table)
        if value.shape not in ((), (n,)) or not parameter.is_possible(value).all():
            raise LevelError(
                f"parameters: {parameter.__name__} must be one number, or a list of {n}, one for each level;"
                f" each {parameter.possible_values()}; not {value.tolist()!r}"
            )
        table[:, column] = value
