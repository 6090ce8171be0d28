"""Which slots of a layout match which patterns: known when the kernel is made, or by a bit when it runs.

Slots of equal types form a *group*, over which the kernel loops. Where all types of a group hold a factor, the group
matches. Where only some do, a bit in the mask of the entity decides, and the mask follows from the entity's type.
"""

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np

from segar.errors import RuleError
from segar.language import Entity, Factor, Floor, Layout, Pattern, Position, Slot, Symbol, holds, make, walk

PRESENT = ("present", None, None)
TESTS: dict[str, Callable[[type[Entity], Any, Any], bool]] = {
    "present": lambda kind, _, __: True,
    "has": lambda kind, factor, _: holds(kind, factor) is not None,
    "declares": lambda kind, factor, _: factor in kind.declared,
    "isa": lambda kind, parent, _: issubclass(kind, parent),
    "text": lambda kind, factor, value: kind.declared.get(factor) == value,
}
"""The tests of an entity's type that a bit of its mask can be the result of."""


@dataclass(frozen=True)
class Group:
    """Slots that may hold the same types, or types that make no difference to a stage."""

    slots: tuple[int, ...]
    types: tuple[type[Entity], ...]
    optional: bool

    @property
    def is_single(self) -> bool:
        return len(self.slots) == 1

    @property
    def loop(self) -> str:
        """Source of what a loop over the slots runs over."""
        first, last = self.slots[0], self.slots[-1]
        return f"range({first}, {last + 1})" if last - first + 1 == len(self.slots) else repr(self.slots)


@dataclass
class Matcher:
    """Which groups match what; it numbers the bits that are tested while the kernel runs."""

    layout: Layout
    bits: dict[tuple[str, Any, Any], int] = field(default_factory=dict)

    @cached_property
    def groups(self) -> tuple[Group, ...]:
        return self.merge(lambda slot: slot.types)

    def merge(self, key: Callable[[Slot], Any]) -> tuple[Group, ...]:
        """Groups of the slots with equal keys, in order of their first slot."""
        found: dict[Any, list[int]] = {}
        for index, slot in enumerate(self.layout.slots):
            found.setdefault(key(slot), []).append(index)
        groups = []
        for members in found.values():
            parts = [self.layout.slots[i] for i in members]
            types = tuple(dict.fromkeys(t for part in parts for t in part.types))
            groups.append(Group(tuple(members), types, any(part.optional for part in parts)))
        return tuple(groups)

    def match(self, group: Group, needs: Pattern) -> int | None:
        """The mask that an entity of the group must have to match; 0: always; None: never."""
        keys = [("has", factor, None) for factor in needs.factors]
        keys += [("isa", needs.entity_type, None)] if needs.entity_type is not None else []
        return self._mask(group, keys)

    def declares(self, group: Group, factor: type[Factor]) -> int | None:
        """As :meth:`match`, for entities that hold the factor itself and not a sub-class of it."""
        return self._mask(group, [("declares", factor, None)])

    def _mask(self, group: Group, keys: list[tuple[str, Any, Any]]) -> int | None:
        mask = 0
        for key in keys:
            part = self.type_test(group, key)
            if part is None:
                return None
            mask |= part
        return self._bit(PRESENT) if mask == 0 and group.optional else mask

    def type_test(self, group: Group, key: tuple[str, Any, Any]) -> int | None:
        """As :meth:`match`, for a key of :data:`TESTS` with its arguments: 0 where all types of the group pass the test."""
        what, *details = key
        passed = [TESTS[what](kind, *details) for kind in group.types]
        if all(passed):
            return 0
        return self._bit(key) if any(passed) else None

    def column(self, group: Group, factor: type[Factor]) -> int:
        """The first column of the factor that the group's entities hold for ``factor``."""
        held = {holds(t, factor) for t in group.types} - {None}
        if len(held) != 1:
            names = sorted(f.__name__ for f in held if f)
            raise RuleError(
                f"a slot may be filled by {', '.join(t.__name__ for t in group.types)}, which hold different factors"
                f" ({', '.join(names) or 'none'}) for {factor.__name__}; give them separate entries in 'numbers'"
            )
        return self.layout.columns[held.pop()]  # type: ignore[index]

    def masks(self) -> np.ndarray:
        """int64 mask of each type of the layout, and last, for an absent entity, 0."""
        table = np.zeros(len(self.layout.types) + 1, dtype=np.int64)
        for index, kind in enumerate(self.layout.types):
            for (what, *details), bit in self.bits.items():
                table[index] |= bit if TESTS[what](kind, *details) else 0
        return table

    def _bit(self, key: tuple[str, Any, Any]) -> int:
        if key not in self.bits:
            if len(self.bits) == 62:
                raise RuleError("more than 62 kinds of matching that depend on the sampled type")
            self.bits[key] = 1 << len(self.bits)
        return self.bits[key]


def simplified_truth(matcher: Matcher, symbol: Symbol, groups: dict[str, Group]) -> Symbol:
    """A bound relation's truth with all parts replaced by True or False that the groups alone decide."""
    found: dict[Symbol, Symbol] = {}
    for part in walk(symbol):
        parts = [found[s] for s in part.args] if part.op in ("not", "and", "or") else []
        if part.op == "not":
            found[part] = parts[0].negate()
        elif parts:
            ends = make("const", part.op == "or")  # the truth that decides alone
            left = [p for p in parts if p.op != "const"]
            if any(p is ends for p in parts):
                found[part] = ends
            else:
                found[part] = make(part.op, *left) if len(left) == 2 else left[0] if left else ends.negate()
        else:
            answer = static_relation(matcher, part, groups)
            found[part] = part if answer is None else make("const", answer)
    return found[symbol]


def static_relation(matcher: Matcher, symbol: Symbol, groups: dict[str, Group]) -> bool | None:
    """The truth of a bound relation symbol if the groups alone decide it."""
    if symbol.op != "relation":
        return None
    what, a, b = symbol.args
    if not isinstance(what, str):
        mask = relation_mask(matcher, what, groups[a])
        return None if mask else mask is not None
    floor, place = Pattern((Floor,)), Pattern((Position,))
    if what == "is_on" and matcher.match(groups[b], place) is None:
        return True
    if what in ("is_on", "contains"):
        on_floor = matcher.match(groups[b], floor) is not None
        is_floor = all(Floor in t.declared for t in groups[a].types)
        return None if on_floor and not is_floor and matcher.match(groups[a], place) is not None else False
    return None if all(matcher.match(groups[v], place) is not None for v in (a, b)) else False


def relation_mask(matcher: Matcher, what: tuple[str, Any, Any], group: Group) -> int | None:
    """As :meth:`Matcher.match`, for the part of a relation that an entity's type decides: its text, or what it needs."""
    kind, factors, entity_type = what
    return matcher.type_test(group, what) if kind == "text" else matcher.match(group, Pattern(factors, entity_type))
