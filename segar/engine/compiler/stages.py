"""Rules of one stage -> source: for each target entity, gather the outcomes of all rules on it, then write.

All rules of a stage read the state from before the stage. A factor that some rule of the stage reads on another entity
is therefore written to a second buffer ``W`` and copied when the stage is over; all others are written in place.
"""

from __future__ import annotations

from collections import defaultdict

from segar.engine.compiler.applications import Application, application_symbols, bind_tree
from segar.engine.compiler.conflicts import Takes, check_static, find_disputed, read_across
from segar.engine.compiler.emit import Writer, bind
from segar.engine.compiler.loops import VARIABLES, both, condition, match_test, over_group, share
from segar.engine.compiler.sparse_pairs import Gate, find_gate
from segar.engine.compiler.spec import Group, Matcher, Needs, needs_of, outcomes_of, relation_mask, settle
from segar.errors import RuleError
from segar.language import (
    Aggregate,
    Branch,
    Differential,
    Factor,
    Floor,
    Leaf,
    Outcome,
    Position,
    Rule,
    SetFactor,
    Slot,
    Tree,
    holds,
)


class Stage:
    """Writes the source of one stage.

    Args:
        matcher: groups and bits of the layout.
        rules: the rules of the stage with their numbers in the world.
        takes: whether a rule's outcome belongs to this stage.
        scale: source of the factor on differentials (``dt``; ``1.0`` for actions).
        rates: write the differentials of Position to ``U``, unscaled, instead of changing the state.
    """

    def __init__(
        self, matcher: Matcher, rules: list[tuple[int, Rule]], takes: Takes, scale: str = "dt", rates: bool = False
    ) -> None:
        self.matcher, self.takes, self.scale, self.rates = matcher, takes, scale, rates
        self.applications = []
        for number, rule in rules:
            if len(rule.signature.entities) > len(VARIABLES):
                raise RuleError(f"{rule.where}: a rule can involve at most {len(VARIABLES)} entities")
            needs = needs_of(rule)
            for target in range(len(needs)):
                if any(o.argument == target and takes(rule, o) for o in outcomes_of(rule.tree)):
                    self.applications.append(Application(rule, number, target, needs))
        self.groups = self._indistinct_groups(self.applications)
        self.shared = read_across(matcher, self.groups, self.applications)
        self.list_length = 0
        self.gates = self._find_gates()

    def _indistinct_groups(self, applications: list[Application]) -> tuple[Group, ...]:
        """Slots that match alike and keep what they hold in the same columns share a loop: less source, same result."""
        needs = [n for a in applications for n in a.needs]
        needs += [Needs((Floor, Position), None), Needs((Floor,), None), Needs((Position,), None)]
        by_type = dict.fromkeys(
            s.args[0]
            for a in applications
            for s in application_symbols(a)
            if s.op == "relation" and not isinstance(s.args[0], str)
        )
        factors = {f for n in needs for f in n.factors} | {f for what in by_type if what[0] == "needs" for f in what[1]}

        def key(slot: Slot) -> tuple:
            group = Group((0,), slot.types, False)  # optional slots join the others: one more test, half the source
            held = tuple(frozenset(holds(t, f) for t in slot.types) for f in sorted(factors, key=lambda f: f.__name__))
            floors = tuple(Floor in t.declared for t in slot.types)
            return (
                tuple(self.matcher.match(group, n) for n in needs),
                tuple(relation_mask(self.matcher, what, group) for what in by_type),
                held,
                all(floors),
            )

        return self.matcher.merge(range(len(self.matcher.layout.slots)), key)

    def write(self, w: Writer) -> None:
        """Write the stage; the surroundings define V, W, L, bits, P, dt, key, tick, err and the shape arrays."""
        buffered: list[tuple[Group, int, int]] = []
        for partners in self.gates.values():
            for gate in (g for _, g in partners if g is not None):
                gate.write_list(w)
        for group in self.groups:
            mine = [
                (a, m) for a in self.applications if (m := self.matcher.match(group, a.needs[a.target])) is not None
            ]
            if not mine:
                continue
            with over_group(w, group, "i"):
                buffered += self._write_target(w, group, mine)
        for group, column, width in dict.fromkeys(buffered):
            with over_group(w, group, "i"):
                for c in range(column, column + width):
                    w.line(f"V[i, {c}] = W[i, {c}]")

    def _find_gates(self) -> dict[Application, list[tuple[Group, Gate | None]]]:
        """Pair rules that are quiet about most partners: their groups of partners, and the gates of those."""
        found: dict[Application, list[tuple[Group, Gate | None]]] = {}
        for a in self.applications if not self.rates else ():
            if len(a.needs) != 2 or all(self.matcher.match(g, a.needs[a.target]) is None for g in self.groups):
                continue
            partners: list[tuple[Group, Gate | None]] = []
            for other in self._indistinct_groups([a]):
                mask = self.matcher.match(other, a.needs[1 - a.target])
                if mask is not None:
                    gate = find_gate(a, other, mask, self.list_length, len(found))
                    self.list_length += len(other.slots) if gate is not None else 0
                    partners.append((other, gate))
            if any(gate is not None for _, gate in partners):
                found[a] = partners
        return found

    def _write_target(self, w: Writer, group: Group, mine: list[tuple[Application, int]]) -> list:
        factors = self._factors(group, mine)
        check_static(group, mine, self.takes)
        self.disputed = find_disputed(self.matcher, group, mine, self.takes)
        for column, (_, width, kinds) in factors.items():
            if Aggregate in kinds:
                w.line(f"agg_{column} = False")
            if Differential in kinds:
                w.line(f"dif_{column} = False")
            for c in range(width):
                for kind, prefix in ((Aggregate, "ax"), (Differential, "dx"), (SetFactor, "sx")):
                    if kind in kinds:
                        w.line(f"{prefix}_{column + c} = 0.0")
            if SetFactor in kinds:
                w.line(f"set_{column} = -1")
                if column in self.disputed:
                    w.line(f"by_{column} = -1")
                    w.line(f"rival_{column} = -1")
        if any(self._asks_topmost(a, group) for a, _ in mine):
            self._write_topmost(w)
        unary: dict[str, list[Application]] = defaultdict(list)
        for application, mask in mine:
            if len(application.needs) == 1:
                unary[match_test("i", mask)].append(application)
        for test, applications in unary.items():
            with condition(w, test):
                self._apply(w, applications, {"i": group})
        plain = [(a, mask) for a, mask in mine if len(a.needs) == 2 and a not in self.gates]
        for other in self._indistinct_groups([a for a, _ in plain]):
            self._write_pairs(w, group, other, plain)
        for a, mask in mine:
            for other, gate in self.gates.get(a, ()):
                if gate is None:
                    self._write_pairs(w, group, other, [(a, mask)])
                else:
                    with condition(w, match_test("i", mask)):
                        self._write_gated(w, group, gate)
        for application, mask in mine:
            if len(application.needs) == 3:
                self._write_triples(w, group, application, mask)
        return self._fold(w, group, factors)

    def _write_topmost(self, w: Writer) -> None:
        """Find the floor that entity ``i`` is on, discs inline; as ``topmost`` in the device code."""
        w.line("top_i = -1")
        for floor in self.groups:
            mask = self.matcher.match(floor, Needs((Floor, Position), None))
            if mask is None:
                continue
            with over_group(w, floor, "f"), condition(w, match_test("f", mask)):
                w.line("fx = V[i, X] - V[f, X]")
                w.line("fy = V[i, X + 1] - V[f, X + 1]")
                with w.block("if kind[i] == 1 and kind[f] == 1:"):
                    w.line("fr = 0.5 * (V[i, SIZE] + V[f, SIZE]) + THRESHOLD")
                    w.line("under = fx * fx + fy * fy <= fr * fr")
                with w.block("else:"):
                    w.line("under = over(V, kind, count, vertex, hull_radius, i, f)")
                with w.block("if under and (top_i < 0 or V[f, ORDER] < V[top_i, ORDER]):"):
                    w.line("top_i = f")

    def _write_pairs(self, w: Writer, group: Group, other: Group, mine: list[tuple[Application, int]]) -> None:
        pairs: dict[str, list[Application]] = defaultdict(list)
        for a, mask in mine:
            if not (other.slots == group.slots and group.is_single):
                other_mask = self.matcher.match(other, a.needs[1 - a.target])
                if other_mask is not None and not self._never(a, {"i": group, "j": other}):
                    pairs[both(match_test("i", mask), match_test("j", other_mask))].append(a)
        if not pairs:
            return
        with over_group(w, other, "j"), condition(w, "i != j" if share(other, group) else ""):
            for test, applications in pairs.items():
                with condition(w, test):
                    self._apply(w, applications, {"i": group, "j": other})

    def _write_gated(self, w: Writer, group: Group, gate: Gate) -> None:
        a = gate.application
        with w.block(f"for n in range(listed_{gate.name}):"):
            w.line(f"j = L[{gate.list_at} + n]")
            with condition(w, "i != j" if share(gate.partners, group) else ""):
                w.groups = {"i": group, "j": gate.partners}
                self._merge(w, [(a, gate.rest)], group)
        if not self._matters(a, gate.leaf):
            return
        gate.write_count(w, group)
        w.groups = {"i": group}
        with w.block("if quiet > 0:"):
            self._merge(w, [(a, gate.leaf)], group)
            sums = []
            for o in gate.leaf.outcomes:
                if o.argument == a.target and self.takes(a.rule, o) and o.kind is not SetFactor:
                    column = self.matcher.column(group, o.factor)
                    prefix = "ax" if o.kind is Aggregate else "dx"
                    sums += [(f"{prefix}_{column + c}", w.value(v)) for c, v in enumerate(o.components)]
            if sums:
                gate.write_repeats(w, sums)

    def _write_triples(self, w: Writer, group: Group, a: Application, mask: int) -> None:
        names = [v for v in a.variables if v != "i"]
        needs = {v: a.needs[n] for n, v in enumerate(a.variables)}
        groups = self._indistinct_groups([a])
        for second in groups:
            for third in groups:
                masks = [self.matcher.match(g, needs[v]) for g, v in ((second, names[0]), (third, names[1]))]
                if masks[0] is None or masks[1] is None:
                    continue
                distinct = " and ".join(
                    f"{p} != {q}"
                    for p, q, same in (
                        ("i", "j", share(second, group)),
                        ("i", "k", share(third, group)),
                        ("j", "k", share(second, third)),
                    )
                    if same
                )
                with over_group(w, second, "j"), over_group(w, third, "k"):
                    test = both(distinct, match_test("i", mask), match_test("j", masks[0]), match_test("k", masks[1]))
                    with condition(w, test):
                        self._apply(w, [a], {"i": group, "j": second, "k": third})

    def _apply(self, w: Writer, applications: list[Application], groups: dict[str, Group]) -> None:
        """The trees of rules on the same entities, bound to loop variables; shared conditions are tested once."""
        w.groups = groups
        trees: list[tuple[Application, Tree]] = []
        for a in applications:
            tree = bind_tree(a.rule.tree, a)
            if a.rule.relation is not None:
                truth = settle(self.matcher, bind(a.rule.relation.truth, a.variables, a.number), groups)
                if truth.op == "const" and not truth.args[0]:
                    continue
                if truth.op != "const":
                    tree = Branch(truth, tree, Leaf())
            trees.append((a, tree))
        self._merge(w, trees, groups["i"])

    def _merge(self, w: Writer, trees: list[tuple[Application, Tree]], group: Group) -> None:
        """Write trees one after the other; those that test the same condition first share its ``if``."""
        while trees:
            a, tree = trees[0]
            if isinstance(tree, Leaf):
                mine = [o for o in tree.outcomes if o.argument == a.target and self.takes(a.rule, o)]
                if mine:
                    w.line(f"# {a.rule.name}")
                for outcome in mine:
                    self._gather(w, a, outcome, group)
                trees = trees[1:]
                continue
            same = [(b, t) for b, t in trees if isinstance(t, Branch) and t.condition is tree.condition]
            trees = [(b, t) for b, t in trees if not (isinstance(t, Branch) and t.condition is tree.condition)]
            test = w.value(tree.condition)
            for header, branches in (
                (f"if {test}:", [(b, t.yes) for b, t in same]),
                (f"if not {test}:", [(b, t.no) for b, t in same]),
            ):
                if any(self._matters(b, t) for b, t in branches):
                    with w.block(header):
                        self._merge(w, branches, group)

    def _matters(self, a: Application, tree: Tree) -> bool:
        return any(o.argument == a.target and self.takes(a.rule, o) for o in outcomes_of(tree))

    def _gather(self, w: Writer, a: Application, outcome: Outcome, group: Group) -> None:
        column = self.matcher.column(group, outcome.factor)
        values = [w.value(c) for c in outcome.components]
        if outcome.kind in (Aggregate, Differential):
            flag, sum_ = ("agg", "ax") if outcome.kind is Aggregate else ("dif", "dx")
            w.line(f"{flag}_{column} = True")
            for c, value in enumerate(values):
                w.line(f"{sum_}_{column + c} += {value}")
            return
        priority = a.rule.priority
        with w.block(f"if set_{column} < {priority}:"):
            w.line(f"set_{column} = {priority}")
            for c, value in enumerate(values):
                w.line(f"sx_{column + c} = {value}")
            if column in self.disputed:
                w.line(f"by_{column} = {a.number}")
                w.line(f"rival_{column} = -1")
        if column in self.disputed:
            differs = " or ".join(f"sx_{column + c} != {value}" for c, value in enumerate(values))
            with w.block(f"elif set_{column} == {priority} and ({differs}):"):
                w.line(f"rival_{column} = {a.number}")

    def _fold(self, w: Writer, group: Group, factors: dict) -> list:
        if self.rates:
            self._fold_rates(w, factors)
            return []
        buffered = []
        for column, (factor, width, kinds) in factors.items():
            if SetFactor in kinds and column in self.disputed:
                with w.block(f"if rival_{column} >= 0:"):
                    w.line(f"err[0], err[1], err[2], err[3], err[4] = 1, i, {column}, by_{column}, rival_{column}")
            buffer = "W" if factor in self.shared else "V"
            if buffer == "W":
                buffered.append((group, column, width))
                for c in range(column, column + width):
                    w.line(f"W[i, {c}] = V[i, {c}]")
            word = "if"
            for kind, test, prefix in (
                (SetFactor, f"set_{column} >= 0", "sx"),
                (Aggregate, f"agg_{column}", "ax"),
                (Differential, f"dif_{column}", "dx"),
            ):
                if kind not in kinds:
                    continue
                with w.block(f"{word} {test}:"):
                    for c in range(column, column + width):
                        right = f"{prefix}_{c}" if kind is not Differential else f"V[i, {c}] + dx_{c} * {self.scale}"
                        w.line(f"{buffer}[i, {c}] = {right}")
                word = "elif"
        return buffered

    def _fold_rates(self, w: Writer, factors: dict) -> None:
        for column, (_, _, kinds) in factors.items():
            overruled = [f"set_{column} >= 0"] * (SetFactor in kinds) + [f"agg_{column}"] * (Aggregate in kinds)
            for c in (0, 1):
                rate = f"dx_{column + c}" if Differential in kinds else "0.0"
                w.line(f"U[i, {c}] = " + (f"0.0 if {' or '.join(overruled)} else {rate}" if overruled else rate))

    def _factors(self, group: Group, mine: list[tuple[Application, int]]) -> dict:
        """Column -> (factor, width, kinds of outcomes) for all that the stage may change in this group."""
        found: dict[int, tuple[type[Factor], int, set]] = {}
        for a, _ in mine:
            for outcome in outcomes_of(a.rule.tree):
                if outcome.argument == a.target and self.takes(a.rule, outcome):
                    column = self.matcher.column(group, outcome.factor)
                    entry = found.setdefault(column, (outcome.factor, outcome.factor.width, set()))  # type: ignore[attr-defined]
                    entry[2].add(outcome.kind)
        return found

    def _asks_topmost(self, a: Application, group: Group) -> bool:
        return any(
            s.op == "relation" and s.args[0] in ("is_on", "contains") and a.variables[s.args[1]] == "i"
            for s in application_symbols(a)
        )

    def _never(self, a: Application, groups: dict[str, Group]) -> bool:
        """Whether the relation is false for all entities of these groups."""
        if a.rule.relation is None:
            return False
        truth = settle(self.matcher, bind(a.rule.relation.truth, a.variables, a.number), groups)
        return truth.op == "const" and not truth.args[0]
