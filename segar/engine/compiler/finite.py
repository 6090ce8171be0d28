"""The test of a state after a step -> source: whether the numbers that rules may change are finite."""

from collections import defaultdict
from collections.abc import Iterator, Sequence

from segar import language
from segar.engine.compiler.emit import condition, match_test, over_group
from segar.engine.compiler.source import Source


def finite_test(source: Source, rules: Sequence[language.Rule]) -> str:
    """``is_finite(V, bits)``: whether all numbers that these rules compute are finite.

    Other numbers stay as they were, or become constants; those that levels start with are finite.
    """
    with source.function("is_finite(V, bits)", inline=True) as w:
        w.line("finite = True")
        for group in source.matcher.groups:
            changed = {held for rule in rules for kind in group.types for held in changed_of_type(rule, kind)}
            columns: dict[int, list[int]] = defaultdict(list)
            for factor in source.layout.columns:
                mask = source.matcher.declares(group, factor) if factor in changed else None
                if mask is not None:
                    first = source.layout.columns[factor]
                    columns[mask] += range(first, first + factor.width)
            if columns:
                with over_group(w, group, "i"):
                    for mask, mine in columns.items():
                        with condition(w, match_test("i", mask)):
                            for column in mine:
                                w.line(f"finite &= abs(V[i, {column}]) < np.inf")
        w.line("return finite")
    return w.text()


def changed_of_type(rule: language.Rule, kind: type[language.Entity]) -> Iterator[type[language.Factor]]:
    """The factors of an entity type that a rule may change, except to constants."""
    for effect in language.effects_of(rule.tree):
        if all(part.op == "const" and abs(part.args[0]) < float("inf") for part in effect.components):
            continue
        held = language.holds(kind, effect.factor)
        if held is not None and language.matches(kind, rule.needs[effect.argument]):
            yield held
