"""What a world needs of a layout, made explicit: which slots match which patterns, statically or by a bit.

Slots of equal types form a *group*, over which the kernel loops. Where all types of a group hold a factor the match is
static; where only some do, a bit of the entity's mask says so, and the mask follows from the entity's type.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np

from segar.errors import RuleError
from segar.language import (
    Branch,
    Entity,
    Factor,
    Floor,
    Layout,
    Leaf,
    Position,
    Rule,
    Slot,
    Symbol,
    Tree,
    holds,
    make,
    walk,
)

PRESENT = ("present", None, None)


@dataclass(frozen=True)
class Group:
    """Slots that may hold the same types, or types that a stage need not tell apart."""

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
    """Answers which groups match what, and numbers the bits that dynamic answers need."""

    layout: Layout
    bits: dict[tuple[str, Any, Any], int] = field(default_factory=dict)

    @cached_property
    def groups(self) -> tuple[Group, ...]:
        return self.merge(range(len(self.layout.slots)), lambda slot: slot.types)

    def merge(self, slots: Iterable[int], key: Callable[[Slot], Any]) -> tuple[Group, ...]:
        """Groups of the slots with equal keys, in order of their first slot."""
        found: dict[Any, list[int]] = {}
        for index in slots:
            found.setdefault(key(self.layout.slots[index]), []).append(index)
        groups = []
        for members in found.values():
            parts = [self.layout.slots[i] for i in members]
            types = tuple(dict.fromkeys(t for part in parts for t in part.types))
            groups.append(Group(tuple(members), types, any(part.optional for part in parts)))
        return tuple(groups)

    def match(self, group: Group, needs: Needs) -> int | None:
        """The mask that an entity of the group must have to match; 0: always; None: never."""
        mask = 0
        for factor in needs.factors:
            answer = self._ask(group, ("has", factor, None), lambda t, f=factor: holds(t, f) is not None)
            if answer is None:
                return None
            mask |= answer
        if needs.entity_type is not None:
            kind = needs.entity_type
            answer = self._ask(group, ("isa", kind, None), lambda t: issubclass(t, kind))
            if answer is None:
                return None
            mask |= answer
        if mask == 0 and group.optional:
            mask = self._bit(PRESENT)
        return mask

    def text(self, group: Group, factor: type[Factor], value: str) -> int | None:
        """As :meth:`match`, for the condition that a text factor equals ``value``."""
        return self._ask(group, ("text", factor, value), lambda t: t.declared.get(factor) == value)

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
            for (what, a, b), bit in self.bits.items():
                yes = {
                    "present": lambda k, a, b: True,
                    "has": lambda k, a, b: holds(k, a) is not None,
                    "isa": lambda k, a, b: issubclass(k, a),
                    "text": lambda k, a, b: k.declared.get(a) == b,
                }[what](kind, a, b)
                table[index] |= bit if yes else 0
        return table

    def _ask(self, group: Group, key: tuple[str, Any, Any], test: Any) -> int | None:
        answers = [test(t) for t in group.types]
        if all(answers):
            return 0
        return self._bit(key) if any(answers) else None

    def _bit(self, key: tuple[str, Any, Any]) -> int:
        if key not in self.bits:
            if len(self.bits) == 62:
                raise RuleError("more than 62 kinds of matching that depend on the sampled type")
            self.bits[key] = 1 << len(self.bits)
        return self.bits[key]


@dataclass(frozen=True)
class Needs:
    """All that an entity must have to be an argument of a rule: the pattern's factors and those that the body reads.

    What a relation asks for is not among them: where an entity lacks it, the relation does not hold.
    """

    factors: tuple[type[Factor], ...]
    entity_type: type[Entity] | None


def needs_of(rule: Rule) -> tuple[Needs, ...]:
    """Per entity of the rule, what it must have."""
    read: list[dict[type[Factor], None]] = [dict.fromkeys(p.factors) for p in rule.signature.entities]
    for symbol in symbols_of(rule.tree):
        if symbol.op == "load":
            read[symbol.args[0]].setdefault(symbol.args[1])
    for outcome in outcomes_of(rule.tree):
        read[outcome.argument].setdefault(outcome.factor)
    types = [p.entity_type for p in rule.signature.entities]
    return tuple(Needs(tuple(f), t) for f, t in zip(read, types, strict=True))


def settle(matcher: Matcher, symbol: Symbol, groups: dict[str, Group]) -> Symbol:
    """A bound relation's truth with all parts replaced by True or False that the groups alone decide."""
    if symbol.op == "not":
        part = settle(matcher, symbol.args[0], groups)
        return make("const", not part.args[0]) if part.op == "const" else part.negate()
    if symbol.op in ("and", "or"):
        ends = symbol.op == "or"  # the truth that decides alone
        parts = [settle(matcher, s, groups) for s in symbol.args]
        if any(p.op == "const" and p.args[0] is ends for p in parts):
            return make("const", ends)
        open_ = [p for p in parts if p.op != "const"]
        return make("const", not ends) if not open_ else open_[0] if len(open_) == 1 else make(symbol.op, *open_)
    answer = static_relation(matcher, symbol, groups)
    return symbol if answer is None else make("const", answer)


def static_relation(matcher: Matcher, symbol: Symbol, groups: dict[str, Group]) -> bool | None:
    """The truth of a bound relation symbol if the groups alone decide it."""
    if symbol.op != "relation":
        return None
    what, a, b = symbol.args
    if not isinstance(what, str):
        mask = relation_mask(matcher, what, groups[a])
        return None if mask else mask is not None
    floor, place = Needs((Floor,), None), Needs((Position,), None)
    if what == "is_on" and matcher.match(groups[b], place) is None:
        return True
    if what in ("is_on", "contains"):
        on_floor = matcher.match(groups[b], floor) is not None
        is_floor = all(Floor in t.declared for t in groups[a].types)
        return None if on_floor and not is_floor and matcher.match(groups[a], place) is not None else False
    return None if all(matcher.match(groups[v], place) is not None for v in (a, b)) else False


def relation_mask(matcher: Matcher, what: tuple, group: Group) -> int | None:
    """As :meth:`Matcher.match`, for the part of a relation that an entity's type decides: its text, or what it has."""
    kind, *details = what
    return matcher.text(group, *details) if kind == "text" else matcher.match(group, Needs(*details))


def symbols_of(tree: Tree) -> list[Symbol]:
    """All symbols of a tree, conditions and outcomes, each once."""
    seen: dict[Symbol, None] = {}
    stack: list[Tree] = [tree]
    while stack:
        node = stack.pop()
        if isinstance(node, Branch):
            for symbol in walk(node.condition):
                seen.setdefault(symbol)
            stack += [node.yes, node.no]
            continue
        roots = [c for outcome in node.outcomes for c in outcome.components]
        for root in roots + ([node.value] if node.value is not None else []):
            for symbol in walk(root):
                seen.setdefault(symbol)
    return list(seen)


def outcomes_of(tree: Tree) -> list[Any]:
    """All outcomes at the leaves of a tree."""
    return [outcome for leaf in leaves_of(tree) for outcome in leaf.outcomes]


def leaves_of(tree: Tree) -> list[Leaf]:
    """All leaves of a tree."""
    return [tree] if isinstance(tree, Leaf) else leaves_of(tree.yes) + leaves_of(tree.no)
