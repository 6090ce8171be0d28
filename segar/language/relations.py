"""Relations: typed functions that return a truth value, and decide on which entities a rule applies.

Attach them to a rule (``@rule(relation=is_on)``) or combine them first (``is_on & is_equal(Mobile, True)``). The i-th
entity of a relation is the i-th entity of the rule.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from segar.errors import RuleError
from segar.language.entities import Entity, Thing
from segar.language.factors import ID, Factor, Label
from segar.language.pickling import ByName
from segar.language.signature import EntityView, Pattern, Signature, code_place, read_signature, symbolic_arguments
from segar.language.symbols import Symbol, make, walk
from segar.language.tracing import Leaf, Tree, trace, truth_leaf

SPECIFICITY_PLAIN = 1  # any relation that is not an equality; the other numbers rank equalities (2022: rules)
SPECIFICITY_EQUAL = 2
SPECIFICITY_LABEL = 7
SPECIFICITY_ID = 8


@dataclass(frozen=True)
class Relation(ByName):
    """A condition on entities.

    Attributes:
        truth: expression of the condition; false where an entity does not have what the relation needs.
        needs: what each entity must have.
        specificity: how specific a rule with this relation is, when rules disagree.
        parts: the two relations that were combined; empty for a relation that is a function.
    """

    function: Callable[..., Any]
    signature: Signature
    truth: Symbol
    needs: tuple[Pattern, ...]
    specificity: int = SPECIFICITY_PLAIN
    parts: tuple[Relation, ...] = ()

    def __and__(self, other: Any) -> Relation:
        other = as_relation(other)
        return _combine("and", self, other, self.specificity + other.specificity)

    def __or__(self, other: Any) -> Relation:
        other = as_relation(other)
        return _combine("or", self, other, max(self.specificity, other.specificity))


def relation(function: Callable[..., bool]) -> Relation:
    """The relation of a typed function that returns a truth value; raises :class:`RuleError`."""
    return as_relation(function)


def as_relation(function: Any, specificity: int = SPECIFICITY_PLAIN) -> Relation:
    """A relation from a typed function; relations pass through."""
    if isinstance(function, Relation):
        return function
    signature = read_signature(function, returns_effects=False)
    if signature.uses("action") or signature.uses("wall"):
        raise RuleError(f"{code_place(function)}: a relation cannot take Action or Wall")
    truth = truth_of(trace(function, symbolic_arguments(signature), truth_leaf, code_place(function)))
    if any(s.op == "draw" for s in walk(truth)):
        raise RuleError(f"{code_place(function)}: a relation cannot draw random numbers; draw them in the rule")
    needs = _needs(signature, truth)
    for index, need in enumerate(needs):
        if need.factors or need.entity_type is not None:
            truth = make("relation", ("needs", need.factors, need.entity_type), index, index) & truth
    return Relation(function, signature, truth, needs, specificity)


def truth_of(tree: Tree) -> Symbol:
    """The decision tree of a truth-valued function as one expression."""
    if isinstance(tree, Leaf):
        assert tree.value is not None
        return tree.value
    yes, no = truth_of(tree.yes), truth_of(tree.no)
    return (tree.condition & yes) | (tree.condition.negate() & no)


def _needs(signature: Signature, truth: Symbol) -> tuple[Pattern, ...]:
    """What each entity must have: the factors of its pattern and those that the function reads."""
    loads = [s for s in walk(truth) if s.op == "load"]
    needs = []
    for index, pattern in enumerate(signature.entities):
        read = [s.args[1] for s in loads if s.args[0] == index]
        kind = None if pattern.entity_type is Entity else pattern.entity_type
        needs.append(Pattern(tuple(dict.fromkeys((*pattern.factors, *read))), kind))
    return tuple(needs)


def _combine(how: str, a: Relation, b: Relation, specificity: int) -> Relation:
    def combined(*_: Any) -> Any:
        raise NotImplementedError("a combined relation is evaluated by its parts")

    combined.__name__ = f"({a.name} {how} {b.name})"
    signature = max(a.signature, b.signature, key=lambda s: len(s.entities))
    return Relation(combined, signature, make(how, a.truth, b.truth), signature.entities, specificity, (a, b))


def is_equal(factor: type[Factor], value: Any) -> Relation:
    """The relation that an entity's factor equals ``value``: Label and ID by type, numbers by state."""
    specificity = {ID: SPECIFICITY_ID, Label: SPECIFICITY_LABEL}.get(factor, SPECIFICITY_EQUAL)
    checked = factor.check(value)

    def equals(entity: Entity) -> bool:
        return entity[factor] == checked  # type: ignore[return-value]

    equals.__name__ = f"{factor.__name__} == {value!r}"
    return as_relation(equals, specificity)


def _geometric(name: str, a: Any, b: Any) -> Any:
    """The truth of a geometric relation of two entities, as a rule sees them."""
    if not isinstance(a, EntityView) or not isinstance(b, EntityView):
        raise TypeError(f"{name} takes two entities of the rule")
    return a.relation(name, b)


@as_relation
def is_on(thing: Entity, tile: Entity) -> bool:
    """``tile`` is the topmost floor under ``thing``'s centre or rim; a tile without a position is under all entities."""
    return _geometric("is_on", thing, tile)


@as_relation
def overlaps(a: Thing, b: Thing) -> bool:
    """The outlines of two things overlap (a disc overlaps a hull where its centre lies inside)."""
    return _geometric("overlaps", a, b)


@as_relation
def contains(thing: Entity, tile: Entity) -> bool:
    """``thing`` is on ``tile`` and lies wholly inside its outline."""
    return _geometric("contains", thing, tile)
