"""What can be said of a stage before it runs: rules that must contradict each other, those that may, and what is read across
entities."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable, Sequence
from itertools import pairwise

from segar.engine.compiler.applications import Application
from segar.engine.compiler.spec import Group, Matcher, leaves_of, symbols_of
from segar.errors import ConflictError
from segar.language import Branch, Factor, Order, Outcome, Position, Rule, SetFactor, Size, walk

Takes = Callable[[Rule, Outcome], bool]
"""Whether a rule's outcome belongs to the stage."""


def check_static(group: Group, mine: Sequence[tuple[Application, int]], takes: Takes) -> None:
    """Raise where two rules on single entities always set one factor and neither is more specific."""
    setters = defaultdict(list)
    for a, _ in mine:
        if len(a.needs) == 1 and a.rule.relation is None and not isinstance(a.rule.tree, Branch):
            for o in a.rule.tree.outcomes:
                if o.kind is SetFactor and takes(a.rule, o):
                    setters[(o.factor, a.rule.priority)].append((a, o))
    for (factor, _), found in setters.items():
        for (a, first), (b, second) in pairwise(found):
            # Symbols are interned: the same expression is the same object.
            if any(p is not q for p, q in zip(first.components, second.components, strict=True)):
                raise ConflictError(
                    f"{a.rule.where} and {b.rule.where} both always set {factor.__name__} of"
                    f" {group.types[0].__name__}, and neither is more specific; remove one, add a relation, or give"
                    " one a priority"
                )


def find_disputed(matcher: Matcher, group: Group, mine: Sequence[tuple[Application, int]], takes: Takes) -> set[int]:
    """Columns on which outcomes of equal priority can meet: of two rules, of one over several partners, or of one
    that speaks twice."""
    most: dict[tuple[int, int], int] = defaultdict(int)
    for a, _ in mine:
        said: dict[int, int] = defaultdict(int)
        for leaf in leaves_of(a.rule.tree):
            columns = [
                matcher.column(group, o.factor)
                for o in leaf.outcomes
                if o.argument == a.target and o.kind is SetFactor and takes(a.rule, o)
            ]
            for column in columns:
                said[column] = max(said[column], columns.count(column) * len(a.needs))
        for column, count in said.items():
            most[column, a.rule.priority] += count
    return {column for (column, _), count in most.items() if count > 1}


def read_across(matcher: Matcher, groups: Sequence[Group], applications: Sequence[Application]) -> set[type[Factor]]:
    """Factors that some rule reads on an entity that is not its target."""
    shared: set[type[Factor]] = set()
    for a in applications:
        if not _has_partners(matcher, groups, a):
            continue
        symbols = symbols_of(a.rule.tree)
        if a.rule.relation is not None:
            symbols += walk(a.rule.relation.truth)
        for symbol in symbols:
            if symbol.op == "load" and symbol.args[0] != a.target:
                shared |= _family(symbol.args[1])
            if symbol.op == "relation" and isinstance(symbol.args[0], str):
                shared |= {Position, Order, Size}
    return shared


def _has_partners(matcher: Matcher, groups: Sequence[Group], a: Application) -> bool:
    """Whether some entity can be another argument of the rule beside a target."""
    targets = [g for g in groups if matcher.match(g, a.needs[a.target]) is not None]
    for other, need in enumerate(a.needs):
        partners = [g for g in groups if matcher.match(g, need) is not None]
        if other != a.target and any(t is not p or not t.is_single for t in targets for p in partners):
            return True
    return False


def _family(factor: type[Factor]) -> set[type[Factor]]:
    return _descendants(factor) | {b for b in factor.__mro__ if issubclass(b, Factor)}


def _descendants(factor: type[Factor]) -> set[type[Factor]]:
    return {factor}.union(*map(_descendants, factor.__subclasses__()))
