"""The functions of a task -> source: reward, end, success and death, over every tuple of entities that matches."""

from dataclasses import dataclass

from segar.engine.compiler.emit import VARIABLES, Writer, both, condition, match_test, over_group
from segar.engine.compiler.source import STATE, Source, write_value
from segar.engine.compiler.spec import Group
from segar.errors import RuleError
from segar.language import Rule, TaskFunctions

# Of each kind of reduction: its start, and the statement that uses a value.
REDUCTIONS = {
    "every": ("True", "met, reduced = True, reduced and {}"),
    "best": ("-np.inf", "met, reduced = True, max(reduced, {})"),
}


def task_functions(source: Source, task: TaskFunctions, first: int) -> list[str]:
    """``reward_of``, ``terminated_of``, ``success_of`` and ``death_of``; the task's rules are numbered from ``first``."""
    texts = []
    for name in ("reward", "terminated", "success", "death"):
        rules: tuple[Rule, ...] = getattr(task, name)
        texts.append(_value_function(source, name, rules, first))
        first += len(rules)
    return texts


def _value_function(source: Source, name: str, rules: tuple[Rule, ...], first: int) -> str:
    """The sum of the rules' numbers, or whether any of their truths holds, over all tuples of entities that match."""
    start, add = ("0.0", "total += {}") if name == "reward" else ("False", "total = total or {}")
    with source.function(f"{name}_of({STATE})", inline=True) as w:
        source.write_parameters(w)
        w.line(f"# {', '.join(rule.name for rule in rules)}")
        w.line(f"total = {start}")
        for number, rule in enumerate(rules, first):
            with w.scope():
                found = _Values(source, w, rule, number).write({}, add)
            if rule.needs and not found:
                raise _unmatched(source, rule)
        w.line("return total")
    return w.text()


def _unmatched(source: Source, rule: Rule) -> RuleError:
    wanted = [n.entity_type.__name__ if n.entity_type else str([f.__name__ for f in n.factors]) for n in rule.needs]
    present = [t.__name__ for t in source.layout.types]
    return RuleError(
        f"{rule.where}: the task needs {' and '.join(wanted)}, but the levels have only {', '.join(present)};"
        " choose the task that these levels are for (task=...)"
    )


@dataclass(frozen=True)
class _Values:
    """Writes the loops over a rule's entities, and in the innermost one the rule's value."""

    source: Source
    w: Writer
    rule: Rule
    number: int

    def write(self, groups: dict[str, Group], statement: str) -> bool:
        """Write what is left to do inside the loops over ``groups`` (by variable); returns whether any entity can match.

        Args:
            statement: source that uses a value.
        """
        signature, count = self.rule.signature, len(self.rule.needs)
        if len(groups) == count:
            self.w.groups = dict(groups)
            write_value(self.w, self.rule.tree, VARIABLES[:count], statement, self.number)
            return True
        if not signature.reduced or len(groups) != count - signature.reduced:
            return self._write_loops(groups, statement)
        start, reduce = REDUCTIONS[signature.reduction]
        self.w.line(f"met, reduced = False, {start}")
        found = self._write_loops(groups, reduce)
        with self.w.block("if met:"):
            self.w.line(statement.format("reduced"))
        return found

    def _write_loops(self, groups: dict[str, Group], statement: str) -> bool:
        """Write one loop for each group that may hold the next entity."""
        variable, need, found = VARIABLES[len(groups)], self.rule.needs[len(groups)], False
        for group in self.source.matcher.groups:
            mask = self.source.matcher.match(group, need)
            if mask is None or (group.is_single and group in groups.values()):
                continue
            apart = [f"{variable} != {v}" for v, g in groups.items() if g is group]
            with over_group(self.w, group, variable), condition(self.w, both(match_test(variable, mask), *apart)):
                found |= self.write({**groups, variable: group}, statement)
        return found
