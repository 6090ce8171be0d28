"""Entities and factors -> columns: where a batch of states holds each factor.

A state is ``values[env, entity, column]`` (float64). The entity axis has one *slot* for each entity that a level of the
distribution can have; a slot lists the entity types that may fill it. All slots share the columns; a slot's entity that
lacks a factor holds nan there.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

from segar.errors import LevelError, did_you_mean
from segar.language.entities import Entity, entity_name
from segar.language.factors import Factor
from segar.language.parameters import BUILT_IN_PARAMETERS, Parameter


@dataclass(frozen=True)
class Slot:
    """One place for an entity: its name, the types that may fill it, and whether it may stay empty."""

    name: str
    types: tuple[type[Entity], ...]
    optional: bool = False

    def may_have(self, factor: type[Factor]) -> bool:
        """Whether some type of the slot holds the factor or a sub-class of it."""
        return any(holds(t, factor) is not None for t in self.types)

    def must_have(self, factor: type[Factor]) -> bool:
        """Whether every type of the slot holds the factor or a sub-class of it."""
        return all(holds(t, factor) is not None for t in self.types)


@dataclass(frozen=True)
class Layout:
    """The slots of a level distribution and its extra parameters, and the columns that follow from them."""

    slots: tuple[Slot, ...]
    extra_parameters: tuple[type[Parameter], ...] = ()

    @cached_property
    def types(self) -> tuple[type[Entity], ...]:
        """All entity types, in order of first mention; ``Levels.types`` indexes them."""
        return tuple(dict.fromkeys(t for slot in self.slots for t in slot.types))

    @cached_property
    def factors(self) -> tuple[type[Factor], ...]:
        """All factors that have columns, in order of first declaration."""
        return tuple(dict.fromkeys(f for t in self.types for f in t.declared if f.width))

    @cached_property
    def columns(self) -> dict[type[Factor], int]:
        """Factor -> its first column."""
        columns, next_free = {}, 0
        for factor in self.factors:
            columns[factor] = next_free
            next_free += factor.width
        return columns

    @cached_property
    def by_name(self) -> dict[str, tuple[type[Factor], int]]:
        """Factor name -> (factor, its first column)."""
        return {factor.__name__: (factor, column) for factor, column in self.columns.items()}

    @cached_property
    def width(self) -> int:
        """Number of columns."""
        return sum(f.width for f in self.factors)

    @cached_property
    def parameters(self) -> tuple[type[Parameter], ...]:
        """World parameters in the order of ``Levels.parameters``' columns."""
        return tuple(dict.fromkeys(BUILT_IN_PARAMETERS + self.extra_parameters))

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the slots, e.g. ``('golfball', 'goal', 'object1', 'global_friction')``."""
        return tuple(slot.name for slot in self.slots)

    def slot_index(self, name: str) -> int:
        """Index of the slot called ``name``; raises :class:`LevelError`."""
        if name not in self.names:
            raise LevelError(f"no entity is called '{name}'.{did_you_mean(name, self.names)}")
        return self.names.index(name)

    def factor(self, name: str) -> type[Factor]:
        """The factor class called ``name``; raises :class:`LevelError`."""
        if name not in self.by_name:
            raise LevelError(f"no entity has a factor '{name}'.{did_you_mean(name, self.by_name)}")
        return self.by_name[name][0]


def holds(entity: type[Entity], factor: type[Factor]) -> type[Factor] | None:
    """The factor of ``entity`` that a rule asking for ``factor`` gets: itself, else a sub-class of it, else None."""
    if factor in entity.declared:
        return factor
    return next((f for f in entity.declared if issubclass(f, factor)), None)


def name_slots(groups: Sequence[tuple[tuple[type[Entity], ...], int]]) -> list[str]:
    """Names for ``(types, count)`` groups: the entity's name where it is alone, else the common type and a number."""
    names: list[str] = []
    counts: dict[str, int] = {}
    for types, count in groups:
        base = entity_name(_common_parent(types))
        alone = len(types) == 1 and count == 1 and sum(t == types for t, _ in groups) == 1
        for _ in range(count):
            counts[base] = counts.get(base, 0) + 1
            names.append(base if alone else f"{base}{counts[base]}")
    return names


def _common_parent(types: tuple[type[Entity], ...]) -> type[Entity]:
    return next(c for c in types[0].__mro__ if issubclass(c, Entity) and all(issubclass(t, c) for t in types))
