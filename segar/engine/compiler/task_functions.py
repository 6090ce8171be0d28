"""A task's functions -> source: reward, end, success and death, over every tuple of entities that matches."""

from __future__ import annotations

from typing import Any

from segar.engine.compiler.emit import Writer
from segar.engine.compiler.loops import VARIABLES, both, condition, match_test, over_group
from segar.engine.compiler.source import STATE, Source, write_value
from segar.engine.compiler.spec import Group, Needs, needs_of
from segar.errors import RuleError
from segar.language import Rule, TaskFunctions

# Of each kind of reduction: what it starts from, and how it takes a value.
REDUCTIONS = {
    "every": ("True", "met, reduced = True, reduced and {}"),
    "best": ("-np.inf", "met, reduced = True, max(reduced, {})"),
}


def task_functions(source: Source, task: TaskFunctions, first: int) -> list[str]:
    """``reward_of``, ``terminated_of``, ``success_of`` and ``death_of``; the task's rules are numbered from ``first``."""
    source_of = []
    for name in ("reward", "terminated", "success", "death"):
        rules: tuple[Rule, ...] = getattr(task, name)
        start, add = ("0.0", "total += {}") if name == "reward" else ("False", "total = total or {}")
        source_of.append(_value_function(source, f"{name}_of", rules, first, start, add))
        first += len(rules)
    return source_of


def _value_function(source: Source, name: str, rules: tuple[Rule, ...], first: int, start: str, add: str) -> str:
    """A function of the state: evaluated for every tuple of entities that matches, and accumulated."""
    with source.function(f"{name}({STATE})", inline=True) as w:
        source.write_parameters(w)
        w.line(f"# {', '.join(rule.name for rule in rules)}")
        w.line(f"total = {start}")
        for number, rule in enumerate(rules, first):
            needs = needs_of(rule)
            with w.scope():
                found = _nest(source, w, rule, needs, VARIABLES[: len(needs)], {}, add, number)
            if needs and not found:
                raise _unmatched(source, rule, needs)
        w.line("return total")
    return w.text()


def _unmatched(source: Source, rule: Rule, needs: tuple[Needs, ...]) -> RuleError:
    wanted = [n.entity_type.__name__ if n.entity_type else str([f.__name__ for f in n.factors]) for n in needs]
    present = [t.__name__ for t in source.layout.types]
    return RuleError(
        f"{rule.where}: the task needs {' and '.join(wanted)}, but the levels have only {', '.join(present)};"
        " choose the task that these levels are for (task=...)"
    )


def _nest(
    source: Source, w: Writer, rule: Rule, needs: Any, variables: Any, groups: dict[str, Group], add: str, number: int
) -> bool:
    if len(groups) == len(needs):
        w.groups = dict(groups)
        write_value(w, rule.tree, variables, add, number)
        return True
    signature = rule.signature
    if signature.reduced and len(groups) == len(needs) - signature.reduced:
        start, take = REDUCTIONS[signature.reduction]
        w.line(f"met, reduced = False, {start}")
        found = _over_groups(source, w, rule, needs, variables, groups, take, number)
        with w.block("if met:"):
            w.line(add.format("reduced"))
        return found
    return _over_groups(source, w, rule, needs, variables, groups, add, number)


def _over_groups(
    source: Source, w: Writer, rule: Rule, needs: Any, variables: Any, groups: dict[str, Group], add: str, number: int
) -> bool:
    variable, need, found = variables[len(groups)], needs[len(groups)], False
    for group in source.matcher.groups:
        mask = source.matcher.match(group, need)
        if mask is None or (group.is_single and group in groups.values()):
            continue
        apart = [f"{variable} != {v}" for v, g in groups.items() if g is group]
        with over_group(w, group, variable), condition(w, both(match_test(variable, mask), *apart)):
            found |= _nest(source, w, rule, needs, variables, {**groups, variable: group}, add, number)
    return found
