"""What is known of a stage before it runs: rules that always conflict, columns on which rules may conflict, and factors
that are read of other entities."""

from collections import defaultdict
from collections.abc import Callable, Sequence
from itertools import combinations

from segar import language
from segar.engine.compiler.source import Application, application_symbols
from segar.engine.compiler.spec import Group, Matcher
from segar.errors import ConflictError

MayMeet = Callable[[language.Rule, language.Rule], bool]
"""Whether two rules hold in some level together."""


def counted_effects(a: Application, leaf: language.Leaf, counts: language.Counts) -> list[language.EffectExpression]:
    """The effects at a leaf that are on the application's target and count in the stage."""
    return [e for e in leaf.effects if e.argument == a.target and counts(a.rule, e.kind, e.factor)]


def check_certain_conflicts(
    group: Group, applications: Sequence[Application], counts: language.Counts, may_meet: MayMeet
) -> None:
    """Raise :class:`ConflictError` where two rules on single entities always set one factor, equally specific, wherever
    both of them hold, and they do in some level."""
    setters = defaultdict(list)
    for a in applications:
        if len(a.rule.needs) == 1 and a.rule.relation is None and not isinstance(a.rule.tree, language.Branch):
            for e in counted_effects(a, a.rule.tree, counts):
                if e.kind is language.SetFactor:
                    setters[(e.factor, a.rule.priority)].append((a, e))
    for (factor, _), found in setters.items():
        for (a, first), (b, second) in combinations(found, 2):
            # Symbols are interned: the same expression is the same object.
            differ = any(p is not q for p, q in zip(first.components, second.components, strict=True))
            if differ and may_meet(a.rule, b.rule):
                raise ConflictError(
                    f"{a.rule.where} and {b.rule.where} both always set {factor.__name__} of"
                    f" {group.types[0].__name__}, and neither is more specific; remove one, add a relation, or give"
                    " one a priority"
                )


def find_possible_conflicts(
    matcher: Matcher, group: Group, applications: Sequence[Application], counts: language.Counts
) -> set[int]:
    """Columns that may be set twice with equal priority: by two rules, by one rule on several partners, or by a rule
    that sets the column twice."""
    most: dict[tuple[int, int], int] = defaultdict(int)
    for a in applications:
        times: dict[int, int] = defaultdict(int)
        for leaf in language.leaves_of(a.rule.tree):
            effects = counted_effects(a, leaf, counts)
            columns = [matcher.column(group, e.factor) for e in effects if e.kind is language.SetFactor]
            for column in columns:
                times[column] = max(times[column], columns.count(column) * len(a.rule.needs))
        for column, count in times.items():
            most[column, a.rule.priority] += count
    return {column for (column, _), count in most.items() if count > 1}


def read_across(
    matcher: Matcher, groups: Sequence[Group], applications: Sequence[Application]
) -> set[type[language.Factor]]:
    """Factors that some rule reads of an entity that is not its target."""
    shared: set[type[language.Factor]] = set()
    for a in applications:
        if not _has_partners(matcher, groups, a):
            continue
        for symbol in application_symbols(a):
            if symbol.op == "load" and symbol.args[0] != a.target:
                factor = symbol.args[1]
                shared |= _descendants(factor) | {b for b in factor.__mro__ if issubclass(b, language.Factor)}
            if symbol.op == "relation" and isinstance(symbol.args[0], str):
                shared |= {language.Position, language.Order, language.Size}
    return shared


def _has_partners(matcher: Matcher, groups: Sequence[Group], a: Application) -> bool:
    """Whether some entity can be another argument of the rule beside a target."""
    targets = [g for g in groups if matcher.match(g, a.target_needs) is not None]
    for other, need in enumerate(a.rule.needs):
        partners = [g for g in groups if matcher.match(g, need) is not None]
        if other != a.target and any(t is not p or not t.is_single for t in targets for p in partners):
            return True
    return False


def _descendants(factor: type[language.Factor]) -> set[type[language.Factor]]:
    return {factor}.union(*map(_descendants, factor.__subclasses__()))
