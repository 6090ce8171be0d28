"""Entities and factors -> columns: where a batch of states holds each factor, and the factors by name when they are read.

A state is ``values[env, entity, column]`` (float64). The entity axis has one *slot* for each entity that a level of the
distribution can have; a slot lists the entity types that may fill it. All slots share the columns; a slot's entity that
lacks a factor holds nan there.
"""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import accumulate
from types import MappingProxyType

import numpy as np

from segar.errors import LevelError, did_you_mean
from segar.language.entities import Entity, entity_name
from segar.language.factors import Factor, Friction
from segar.language.parameters import BUILT_IN_PARAMETERS, FloorFriction, Parameter
from segar.language.signature import Pattern


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
    """The slots of a level distribution and its extra parameters, and the columns that follow from them.

    Raises:
        LevelError: two entity types, two factors with columns or two world parameters have one name, or an entity has one that
            cannot be printed.
    """

    slots: tuple[Slot, ...]
    extra_parameters: tuple[type[Parameter], ...] = ()

    def __post_init__(self) -> None:
        require_own_names("entity types", self.types)
        require_own_names("factors", self.factors)
        require_own_names("world parameters", self.parameters)
        for name in self.names:
            if not name.isprintable():
                raise LevelError(
                    f"an entity is called {name!a}, with characters that cannot be printed; give it another ID"
                )

    @cached_property
    def types(self) -> tuple[type[Entity], ...]:
        """All entity types, in order of first mention; ``Levels.types`` indexes them."""
        return tuple(dict.fromkeys(t for slot in self.slots for t in slot.types))

    @cached_property
    def factors(self) -> tuple[type[Factor], ...]:
        """All factors that have columns, in order of first declaration."""
        return tuple(dict.fromkeys(f for t in self.types for f in t.declared if f.width))

    def __reduce__(self) -> tuple[object, ...]:
        return Layout, (self.slots, self.extra_parameters)

    @cached_property
    def columns(self) -> Mapping[type[Factor], int]:
        """Factor -> its first column."""
        return MappingProxyType(dict(zip(self.factors, [0, *accumulate(f.width for f in self.factors)], strict=False)))

    @cached_property
    def by_name(self) -> Mapping[str, tuple[type[Factor], int]]:
        """Factor name -> (factor, its first column)."""
        return MappingProxyType({factor.__name__: (factor, column) for factor, column in self.columns.items()})

    def named(self, values: np.ndarray) -> dict[str, np.ndarray]:
        """The factors of states ``(..., entities, columns)`` by name, as views: ``(..., entities)``, of vectors with a last
        axis of 2; nan where an entity lacks the factor."""
        return {
            name: values[..., column] if factor.width == 1 else values[..., column : column + factor.width]
            for name, (factor, column) in self.by_name.items()
        }

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
        if name in self.by_name:
            return self.by_name[name][0]
        if name in (p.__name__ for p in self.parameters):
            raise LevelError(
                f"no entity has a factor '{name}', which is a world parameter: it belongs to the level, in Levels.parameters."
                f" To change it in a running episode, intervene('parameters', {name}, value)"
            )
        raise LevelError(f"no entity has a factor '{name}'.{did_you_mean(name, self.by_name)}")

    def columns_of(self, factor: type[Factor]) -> slice:
        """The columns of a factor."""
        return slice(self.columns[factor], self.columns[factor] + factor.width)

    def set_floor(self, values: np.ndarray, parameters: np.ndarray) -> None:
        """Give the floor, an entity whose factor rules read, the friction that is a parameter of its level, in place.

        Args:
            values: float ``(n, entities, width)``.
            parameters: float ``(n, parameters)``.
        """
        if Friction in self.columns:
            values[:, -1, self.columns[Friction]] = parameters[:, self.parameters.index(FloorFriction)]


def require_own_names(what: str, classes: Iterable[type]) -> None:
    """Raise :class:`LevelError` where two different classes have one name, by which results could not tell them apart.

    Args:
        what: the classes in words, with where they stand, for the message; such as ``"factors"``.
    """
    owners: dict[str, type] = {}
    for cls in classes:
        other = owners.setdefault(cls.__name__, cls)
        if other is not cls:
            raise LevelError(
                f"two {what} are called '{cls.__name__}': {_address(other)} and {_address(cls)}; give one of them another"
                " name"
                + ("" if _address(other) != _address(cls) else ", or define it once: make the levels of both anew")
            )


def holds(entity: type[Entity], factor: type[Factor]) -> type[Factor] | None:
    """The factor of ``entity`` that a rule asking for ``factor`` gets: itself, else a sub-class of it, else None."""
    if factor in entity.declared:
        return factor
    return next((f for f in entity.declared if issubclass(f, factor)), None)


def matches(entity: type[Entity], pattern: Pattern) -> bool:
    """Whether entities of this type have what the pattern asks for."""
    is_kind = pattern.entity_type is None or issubclass(entity, pattern.entity_type)
    return is_kind and all(holds(entity, factor) is not None for factor in pattern.factors)


def _address(cls: type) -> str:
    return f"{cls.__module__}.{cls.__qualname__}"


def name_slots(groups: Sequence[tuple[tuple[type[Entity], ...], int]]) -> list[str]:
    """Names for ``(types, count)`` groups: the entity's name where it is alone, else the common type and a number."""
    names: list[str] = []
    counts: dict[str, int] = {}
    for types, count in groups:
        parent = next(c for c in types[0].__mro__ if issubclass(c, Entity) and all(issubclass(t, c) for t in types))
        base = entity_name(parent)
        alone = len(types) == 1 and count == 1 and sum(t == types for t, _ in groups) == 1
        for _ in range(count):
            counts[base] = counts.get(base, 0) + 1
            names.append(base if alone else f"{base}{counts[base]}")
    return names


class Factors(dict[str, np.ndarray]):
    """Factors by name, and where entities are among them: what functions of a task and scripted players are given.

    Reading one by its name gives a copy; an unknown name is a :class:`LevelError`.

    Args:
        layout: of the levels.
        arrays: name to float64 ``(num_envs, entities)``, vectors ``(num_envs, entities, 2)``, nan where an entity lacks the
            factor, as :meth:`Layout.named` gives them. Of a single environment, they have no first axis.
    """

    def __init__(self, layout: Layout, arrays: Mapping[str, np.ndarray]) -> None:
        super().__init__(arrays)
        self._layout = layout

    @property
    def num_envs(self) -> int:
        """Length of the arrays' first axis."""
        return len(next(iter(self.values())))

    def batch(self) -> "Factors":
        """The factors as those of a batch: the same, or a batch of one of a single environment."""
        name, array = next(iter(self.items()))
        if array.ndim > self._layout.factor(name).width:
            return self
        return Factors(self._layout, {name: array[None] for name, array in self.items()})

    def slots(self, entity_type: type[Entity]) -> list[int]:
        """Places of the arrays' entities where only entities of this type can be; raises :class:`LevelError`."""
        layout = self._layout
        found = [k for k, slot in enumerate(layout.slots) if all(issubclass(t, entity_type) for t in slot.types)]
        if not found:
            raise LevelError(f"none of these levels' entities, {', '.join(layout.names)}, is a {entity_type.__name__}")
        return found

    def __getitem__(self, name: str) -> np.ndarray:
        self._layout.factor(name)
        return super().__getitem__(name).copy()
