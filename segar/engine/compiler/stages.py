"""A stage -> source: for each target entity, gather the effects of all rules on it, then write them to the state.

All rules of a stage read the state from before the stage. A factor that some rule of the stage reads of another entity
is therefore written to a second buffer ``W`` and copied when the stage is over; all others are written in place.

The effects on one factor of one target are added up in an order that no other rule has a say in: rules on single entities
first, then those on pairs, those to which most partners are alike last of these, then those on three entities; among each
of these rule by rule, as the world has them, and for each rule over its partners in the order of slots. So a world in which
some rules are not active gives the same bits as a world without these rules.
"""

from collections import defaultdict
from dataclasses import dataclass, field, replace
from itertools import groupby

from segar import language
from segar.engine.compiler.conflicts import (
    MayMeet,
    check_certain_conflicts,
    counted_effects,
    find_possible_conflicts,
    read_across,
)
from segar.engine.compiler.emit import Writer, active_test, bind, both, condition, match_test, over_group, share
from segar.engine.compiler.source import Application, FactorSetting, application_symbols, bind_tree
from segar.engine.compiler.sparse_pairs import SparsePairs, find_sparse_pairs, without, write_repeats
from segar.engine.compiler.spec import Group, Matcher, relation_mask, simplified_truth
from segar.language import EffectExpression, Factor, Leaf, Pattern, Rule, Stage, Symbol, Tree

Matching = list[tuple[Application, int]]
"""Applications whose target may be in a group, with the mask of bits that a target must have."""


@dataclass
class _Change:
    """A factor that the stage may change in a group: its first column, and the kinds of effects on it."""

    factor: type[Factor]
    column: int
    setting: FactorSetting
    kinds: set[type[language.Effect]] = field(default_factory=set)

    @property
    def columns(self) -> range:
        return range(self.column, self.column + self.factor.width)


class StageWriter:
    """Writes the source of one stage.

    Args:
        matcher: groups and bits of the layout.
        stage: the effects that count, and what becomes of them. A stage that finds rates writes the differentials of
            Position to ``U`` and leaves the state as it is.
        rules: the rules of the stage with their numbers in the kernel.
        may_meet: whether two rules hold in some level together.
    """

    def __init__(self, matcher: Matcher, stage: Stage, rules: list[tuple[int, Rule]], may_meet: MayMeet) -> None:
        self.matcher, self.counts, self.may_meet = matcher, stage.counts, may_meet
        self.finds_rates = stage.operation is language.Operation.FIND_RATES
        self.time_step = "dt" if stage.scales else "1.0"
        numbered = [Application(rule, n, target) for n, rule in rules for target in range(len(rule.needs))]
        self.applications = [a for a in numbered if self._matters(a, a.rule.tree)]
        self.groups = self._indistinct_groups(self.applications)
        self.shared = read_across(matcher, self.groups, self.applications)
        self.list_length = 0
        self.pairs = {} if self.finds_rates else self._find_sparse_pairs()

    @property
    def target_groups(self) -> list[Group]:
        """Groups whose entities the stage may change."""
        return [
            g for g in self.groups if any(self.matcher.match(g, a.target_needs) is not None for a in self.applications)
        ]

    def write(self, w: Writer) -> None:
        """Write the stage; the surroundings define V, W, L, bits, P, dt, key, tick, err and the shape arrays."""
        buffered: list[tuple[Group, int]] = []
        for partners in self.pairs.values():
            for pairs in (p for _, p in partners if p is not None):
                pairs.write_list(w)
        for group in self.groups:
            mine = [(a, m) for a in self.applications if (m := self.matcher.match(group, a.target_needs)) is not None]
            if mine:
                with over_group(w, group, "i"):
                    buffered += self._write_target(w, group, mine)
        for group, column in dict.fromkeys(buffered):
            with over_group(w, group, "i"):
                w.line(f"V[i, {column}] = W[i, {column}]")

    def _indistinct_groups(self, applications: list[Application]) -> tuple[Group, ...]:
        """Slots that match alike and have the same columns share a loop, which gives less source and the same result."""
        needs = [n for a in applications for n in a.rule.needs]
        needs += [
            Pattern((language.Floor, language.Position)),
            Pattern((language.Floor,)),
            Pattern((language.Position,)),
        ]
        symbols = [s for a in applications for s in application_symbols(a) if s.op == "relation"]
        by_type = dict.fromkeys(s.args[0] for s in symbols if not isinstance(s.args[0], str))
        factors = {f for n in needs for f in n.factors} | {f for what in by_type if what[0] == "needs" for f in what[1]}

        def key(slot: language.Slot) -> tuple:
            group = Group((0,), slot.types, False)  # optional slots join the others: one more test, half the source
            held = tuple(
                frozenset(language.holds(t, f) for t in slot.types) for f in sorted(factors, key=lambda f: f.__name__)
            )
            return (
                tuple(self.matcher.match(group, n) for n in needs),
                tuple(relation_mask(self.matcher, what, group) for what in by_type),
                held,
                all(language.Floor in t.declared for t in slot.types),
            )

        return self.matcher.merge(key)

    def _find_sparse_pairs(self) -> dict[Application, list[tuple[Group, SparsePairs | None]]]:
        """Pair rules to which most partners are alike: their groups of partners, and how to write the pairs of these."""
        found: dict[Application, list[tuple[Group, SparsePairs | None]]] = {}
        for a in self.applications:
            if len(a.rule.needs) != 2 or all(self.matcher.match(g, a.target_needs) is None for g in self.groups):
                continue
            partners: list[tuple[Group, SparsePairs | None]] = []
            for other in self._indistinct_groups([a]):
                mask = self.matcher.match(other, a.rule.needs[1 - a.target])
                if mask is not None:
                    pairs = find_sparse_pairs(a, other, mask, self.list_length, len(found))
                    self.list_length += len(other.slots) if pairs is not None else 0
                    partners.append((other, pairs))
            if any(pairs is not None for _, pairs in partners):
                found[a] = partners
        return found

    def _write_target(self, w: Writer, group: Group, mine: Matching) -> list[tuple[Group, int]]:
        """Write the effects on the entities ``i`` of a group; returns the columns that are written to the buffer."""
        applications = [a for a, _ in mine]
        check_certain_conflicts(group, applications, self.counts, self.may_meet)
        self.changes = self._changes(group, applications)
        for change in self.changes.values():
            self._begin(w, change)
        if any(self._needs_topmost(a) for a in applications):
            self._write_topmost(w)
        self._write_unary(w, group, mine)
        plain = [(a, mask) for a, mask in mine if len(a.rule.needs) == 2 and a not in self.pairs]
        for together in self._written_together(group, plain):
            with condition(w, active_test(w, together[0][0].rule)):
                for other in self._partners([a for a, _ in together]):
                    self._write_pairs(w, group, other, together)
        for a, mask in mine:
            with condition(w, active_test(w, a.rule) if a in self.pairs else ""):
                for other, pairs in self.pairs.get(a, ()):
                    if pairs is None:
                        self._write_pairs(w, group, other, [(a, mask)])
                    else:
                        with condition(w, match_test("i", mask)):
                            self._write_sparse_pairs(w, group, pairs)
        for a, mask in mine:
            if len(a.rule.needs) == 3:
                with condition(w, active_test(w, a.rule)):
                    self._write_triples(w, group, a, mask)
        if self.finds_rates:
            self._write_rates(w)
            return []
        for change in self.changes.values():
            self._write_change(w, change)
        return [(group, c) for change in self.changes.values() if change.factor in self.shared for c in change.columns]

    def _changes(self, group: Group, applications: list[Application]) -> dict[int, _Change]:
        """What the stage may change in this group, by column."""
        conflicting = find_possible_conflicts(self.matcher, group, applications, self.counts)
        found: dict[int, _Change] = {}
        for a in applications:
            for effect in self._counted(a, a.rule.tree):
                column = self.matcher.column(group, effect.factor)
                setting = FactorSetting("i", column, effect.factor.width, column in conflicting)
                found.setdefault(column, _Change(effect.factor, column, setting)).kinds.add(effect.kind)
        return found

    def _begin(self, w: Writer, change: _Change) -> None:
        """Write that no rule has an effect on the factor yet."""
        for kind, flag, total in ((language.Aggregate, "agg", "ax"), (language.Differential, "dif", "dx")):
            if kind in change.kinds:
                w.line(f"{flag}_{change.column} = False")
                for c in change.columns:
                    w.line(f"{total}_{c} = 0.0")
        if language.SetFactor in change.kinds:
            change.setting.begin(w)

    def _write_topmost(self, w: Writer) -> None:
        """Find the floor that entity ``i`` is on, discs inline; as ``topmost`` in the device code."""
        w.knows_topmost = True
        w.line("top_i = -1")
        for floor in self.groups:
            mask = self.matcher.match(floor, Pattern((language.Floor, language.Position)))
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

    def _write_unary(self, w: Writer, group: Group, mine: Matching) -> None:
        unary = [(a, mask) for a, mask in mine if len(a.rule.needs) == 1]
        for (_, mask), together in groupby(unary, lambda one: (one[0].rule.active, one[1])):
            applications = [a for a, _ in together]
            with condition(w, both(active_test(w, applications[0].rule), match_test("i", mask))):
                self._apply(w, applications, {"i": group})

    def _written_together(self, group: Group, mine: Matching) -> list[Matching]:
        """Pair rules that share one loop over partners: neighbours that hold in the same levels and share no sum."""
        found: list[Matching] = []
        for a, mask in mine:
            last = found[-1] if found else []
            if (
                last
                and last[0][0].rule.active is a.rule.active
                and not any(self._summed(group, a, a.rule.tree) & self._summed(group, b, b.rule.tree) for b, _ in last)
            ):
                last.append((a, mask))
            else:
                found.append([(a, mask)])
        return found

    def _partners(self, applications: list[Application]) -> list[Group]:
        """Groups of slots for loops over partners, such that the loops one after the other go in the order of slots."""
        needs = [a.rule.needs[1 - a.target] for a in applications]
        found = [
            g for g in self._indistinct_groups(applications) if any(self.matcher.match(g, n) is not None for n in needs)
        ]
        owner = sorted((slot, k) for k, g in enumerate(found) for slot in g.slots)
        runs = [(k, [slot for slot, _ in run]) for k, run in groupby(owner, lambda one: one[1])]
        return [replace(found[k], slots=tuple(slots)) for k, slots in runs]

    def _write_pairs(self, w: Writer, group: Group, other: Group, mine: Matching) -> None:
        by_test: dict[str, list[Application]] = defaultdict(list)  # these share no sum, so their order does not count
        for a, mask in mine:
            if not (other.slots == group.slots and group.is_single):
                other_mask = self.matcher.match(other, a.rule.needs[1 - a.target])
                if other_mask is not None and not _is_false(self._relation(a, {"i": group, "j": other})):
                    by_test[both(match_test("i", mask), match_test("j", other_mask))].append(a)
        if not by_test:
            return
        with over_group(w, other, "j"), condition(w, "i != j" if share(other, group) else ""):
            for test, applications in by_test.items():
                with condition(w, test):
                    self._apply(w, applications, {"i": group, "j": other})

    def _write_sparse_pairs(self, w: Writer, group: Group, pairs: SparsePairs) -> None:
        """Write the effects of all partners on the target ``i``: first of those listed, then of the quiet ones."""
        a, effects = pairs.application, self._counted(pairs.application, pairs.leaf)
        with pairs.listed(w, group):
            self._merge(w, [(a, without(pairs.tree, pairs.leaf))], group)
        if not effects:
            return
        pairs.write_count(w, group)
        w.groups = {"i": group}
        with w.block("if quiet > 0:"):
            self._merge(w, [(a, pairs.leaf)], group)
            summed = [e for e in effects if e.kind is not language.SetFactor]
            named = [pair for e in summed for pair in zip(self._totals(group, e), e.components, strict=True)]
            write_repeats(w, [(name, w.value(component)) for name, component in named])

    def _write_triples(self, w: Writer, group: Group, a: Application, mask: int) -> None:
        names = [v for v in a.variables if v != "i"]
        needs = dict(zip(a.variables, a.rule.needs, strict=True))
        groups = self._indistinct_groups([a])
        for second in groups:
            for third in groups:
                masks = [self.matcher.match(g, needs[v]) for g, v in ((second, names[0]), (third, names[1]))]
                if masks[0] is None or masks[1] is None:
                    continue
                pairs = (("i", "j", second, group), ("i", "k", third, group), ("j", "k", second, third))
                distinct = [f"{p} != {q}" for p, q, one, two in pairs if share(one, two)]
                tests = [match_test("i", mask), match_test("j", masks[0]), match_test("k", masks[1])]
                with over_group(w, second, "j"), over_group(w, third, "k"), condition(w, both(*distinct, *tests)):
                    self._apply(w, [a], {"i": group, "j": second, "k": third})

    def _apply(self, w: Writer, applications: list[Application], groups: dict[str, Group]) -> None:
        """The trees of rules on the same entities, bound to loop variables; shared conditions are tested once."""
        w.groups = groups
        trees: list[tuple[Application, Tree]] = []
        for a in applications:
            tree, truth = bind_tree(a.rule.tree, a), self._relation(a, groups)
            if truth is None or truth.op != "const":
                trees.append((a, tree if truth is None else language.Branch(truth, tree, Leaf())))
            elif truth.args[0]:
                trees.append((a, tree))
        self._merge(w, trees, groups["i"])

    def _relation(self, a: Application, groups: dict[str, Group]) -> Symbol | None:
        """The truth of the rule's relation for entities of these groups; None without a relation."""
        if a.rule.relation is None:
            return None
        return simplified_truth(self.matcher, bind(a.rule.relation.truth, a.variables, a.number), groups)

    def _merge(self, w: Writer, trees: list[tuple[Application, Tree]], group: Group) -> None:
        """Write trees one after the other; those that test the same condition first share its ``if``, unless a tree between
        them adds to the same sum."""
        while trees:
            a, tree = trees[0]
            if isinstance(tree, Leaf):
                effects = self._counted(a, tree)
                if effects:
                    w.line(f"# {a.rule.name}")
                for effect in effects:
                    self._add_effect(w, a, effect, group)
                trees = trees[1:]
                continue
            same, trees = self._same_condition(trees, tree.condition, group)
            test = w.value(tree.condition)
            for header, branches in (
                (f"if {test}:", [(b, t.yes) for b, t in same]),
                (f"if not {test}:", [(b, t.no) for b, t in same]),
            ):
                if any(self._matters(b, t) for b, t in branches):
                    with w.block(header):
                        self._merge(w, branches, group)

    def _same_condition(
        self, trees: list[tuple[Application, Tree]], condition: Symbol, group: Group
    ) -> tuple[list[tuple[Application, language.Branch]], list[tuple[Application, Tree]]]:
        """The trees that test this condition first and may be written before all others, and the others."""
        same: list[tuple[Application, language.Branch]] = []
        others: list[tuple[Application, Tree]] = []
        passed: set[int] = set()  # sums that trees before this one add to
        for a, tree in trees:
            sums = self._summed(group, a, tree)
            if isinstance(tree, language.Branch) and tree.condition is condition and not sums & passed:
                same.append((a, tree))
            else:
                others.append((a, tree))
                passed |= sums
        return same, others

    def _add_effect(self, w: Writer, a: Application, effect: EffectExpression, group: Group) -> None:
        column = self.matcher.column(group, effect.factor)
        values = [w.value(c) for c in effect.components]
        if effect.kind is language.SetFactor:
            self.changes[column].setting.add(w, a.number, a.rule.priority, values)
            return
        w.line(f"{'agg' if effect.kind is language.Aggregate else 'dif'}_{column} = True")
        for name, value in zip(self._totals(group, effect), values, strict=True):
            w.line(f"{name} += {value}")

    def _totals(self, group: Group, effect: EffectExpression) -> list[str]:
        """Local names of the sums that an aggregate or a differential is added to."""
        column, name = self.matcher.column(group, effect.factor), "ax" if effect.kind is language.Aggregate else "dx"
        return [f"{name}_{c}" for c in range(column, column + effect.factor.width)]

    def _write_change(self, w: Writer, change: _Change) -> None:
        """Write the new value: SetFactor wins over Aggregate, and Aggregate over Differential."""
        column = change.column
        if language.SetFactor in change.kinds:
            change.setting.report_conflict(w)
        state = "W" if change.factor in self.shared else "V"
        if state == "W":
            for c in change.columns:
                w.line(f"W[i, {c}] = V[i, {c}]")
        tests = {
            language.SetFactor: change.setting.is_set,
            language.Aggregate: f"agg_{column}",
            language.Differential: f"dif_{column}",
        }
        for n, kind in enumerate(kind for kind in tests if kind in change.kinds):
            with w.block(f"{'elif' if n else 'if'} {tests[kind]}:"):
                if kind is language.SetFactor:
                    change.setting.store(w, state)
                    continue
                for c in change.columns:
                    value = f"ax_{c}" if kind is language.Aggregate else f"V[i, {c}] + dx_{c} * {self.time_step}"
                    w.line(f"{state}[i, {c}] = {value}")

    def _write_rates(self, w: Writer) -> None:
        """Write the sums of differentials to ``U``; a position that some rule sets or aggregates has the rate 0."""
        for change in self.changes.values():
            replaced = [change.setting.is_set] * (language.SetFactor in change.kinds)
            replaced += [f"agg_{change.column}"] * (language.Aggregate in change.kinds)
            for axis, c in enumerate(change.columns):
                rate = f"dx_{c}" if language.Differential in change.kinds else "0.0"
                w.line(f"U[i, {axis}] = " + (f"0.0 if {' or '.join(replaced)} else {rate}" if replaced else rate))

    def _counted(self, a: Application, tree: Tree) -> list[EffectExpression]:
        """The effects at the leaves of a tree that are on the application's target and count in this stage."""
        return [effect for leaf in language.leaves_of(tree) for effect in counted_effects(a, leaf, self.counts)]

    def _summed(self, group: Group, a: Application, tree: Tree) -> set[int]:
        """First columns of the factors of the group that a tree adds to."""
        effects = self._counted(a, tree)
        return {self.matcher.column(group, e.factor) for e in effects if e.kind is not language.SetFactor}

    def _matters(self, a: Application, tree: Tree) -> bool:
        return bool(self._counted(a, tree))

    def _needs_topmost(self, a: Application) -> bool:
        """Whether the rule's relation needs the floor that its target is on."""
        symbols = [s for s in application_symbols(a) if s.op == "relation" and s.args[0] in ("is_on", "contains")]
        return any(a.variables[s.args[1]] == "i" for s in symbols)


def _is_false(truth: Symbol | None) -> bool:
    return truth is not None and truth.op == "const" and not truth.args[0]
