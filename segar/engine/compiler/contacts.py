"""Contacts -> source: which bodies are solid or movable, what a wall and another body do, which rules note a contact, and
whether any bodies may touch."""

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import permutations

from segar import language
from segar.engine.compiler.checks import check_contact_rule
from segar.engine.compiler.emit import Writer, active_test, bind, both, condition, match_test, over_group
from segar.engine.compiler.source import FactorSetting, Source, write_tree, write_value
from segar.engine.compiler.spec import Group, Matcher
from segar.errors import RuleError


@dataclass(frozen=True)
class _Note:
    """A rule with its number, and of each argument the mask and the types of the bodies that match it."""

    rule: language.Rule
    number: int
    masks: tuple[int, ...]
    groups: tuple[Group, ...]


class ContactNotes:
    """Writes the source for the bodies of one contact.

    Args:
        group: all entities that collide; rules with an argument that none of them matches are left out.
        bodies: the variables that hold the bodies; a rule on two applies in both orders.
        rules: rules on that many bodies, with their numbers in the kernel.
    """

    def __init__(
        self, matcher: Matcher, group: Group, bodies: tuple[str, ...], rules: list[tuple[int, language.Rule]]
    ) -> None:
        self.matcher, self.bodies = matcher, bodies
        self.notes: list[_Note] = []
        for number, rule in rules:
            check_contact_rule(rule)
            masks = [matcher.match(group, need) for need in rule.needs]
            if None not in masks:
                # Only the types that match decide about columns.
                kinds = [tuple(t for t in group.types if language.matches(t, need)) for need in rule.needs]
                groups = tuple(replace(group, types=some) for some in kinds)
                self.notes.append(_Note(rule, number, tuple(m or 0 for m in masks), groups))
        orders = list(permutations(bodies))
        settings = [
            self._setting(n, e, o) for n in self.notes for e in language.effects_of(n.rule.tree) for o in orders
        ]
        self.settings = list(dict.fromkeys(settings))

    def gather(self, w: Writer) -> None:
        """Evaluate every rule, in every order of the bodies."""
        for setting in self.settings:
            setting.begin(w)
        for note in self.notes:
            for order in permutations(self.bodies):
                w.line(f"# {note.rule.name}")
                w.groups = dict(zip(order, note.groups, strict=True))
                tests = [match_test(body, mask) for body, mask in zip(order, note.masks, strict=True)]
                with condition(w, both(active_test(w, note.rule), *tests)):
                    self._write_effects(w, note, order)

    def write(self, w: Writer) -> None:
        """Set the factors."""
        for setting in self.settings:
            setting.report_conflict(w)
            with w.block(f"if {setting.is_set}:"):
                setting.store(w)

    def _setting(self, note: _Note, effect: language.EffectExpression, order: tuple[str, ...]) -> FactorSetting:
        column = self.matcher.column(note.groups[effect.argument], effect.factor)
        return FactorSetting(order[effect.argument], column, effect.factor.width)

    def _write_effects(self, w: Writer, note: _Note, order: tuple[str, ...]) -> None:
        def write_leaf(leaf: language.Leaf) -> None:
            for effect in leaf.effects:
                values = [w.value(bind(component, order, note.number)) for component in effect.components]
                self._setting(note, effect, order).add(w, note.number, note.rule.priority, values)

        write_tree(w, note.rule.tree, order, note.number, write_leaf)


COLLIDES = language.Pattern((language.Collides, language.Position, language.Velocity))


@dataclass(frozen=True)
class Contacts:
    """Writes the functions that ``runtime/contacts.py`` calls by name while it resolves contacts."""

    source: Source
    world: language.WorldRules
    rules: list[language.Rule]

    @property
    def matcher(self) -> Matcher:
        return self.source.matcher

    @cached_property
    def bodies(self) -> Group:
        """All entities that collide, as one group without types where there is none.

        Contacts find their bodies by index, not by a loop over a group.
        """
        groups = [g for g in self.matcher.groups if self.matcher.match(g, COLLIDES) is not None]
        types = tuple(dict.fromkeys(t for g in groups for t in g.types))
        return Group(tuple(range(len(self.source.layout.slots))), types, False)

    def solid(self) -> str:
        """Whether a body takes part in collisions of pairs; a body that the world's function does not take does."""
        rule = self.world.solid
        with self.source.function("solid(V, bits, i)") as w:
            if self.world.pair_contact is None or rule is None:
                w.line(f"return {self.world.pair_contact is not None}")
                return w.text()
            check_contact_rule(rule)
            if rule.signature.parameters:
                raise RuleError(f"{rule.where}: what is solid cannot depend on world parameters")
            mask = self._mask(rule.needs[0])
            w.groups = {"i": self.bodies}
            w.line(f"# {rule.name}")
            w.line("total = True")
            if mask is not None:
                with condition(w, match_test("i", mask)):
                    write_value(w, rule.tree, ("i",), "total = {}")
            w.line("return total")
        return w.text()

    def movable(self) -> str:
        """Whether a contact may push a body."""
        mask = self._mask(language.Pattern((language.Mobile,)))
        with self.source.function("movable(V, bits, i)") as w:
            if mask is None:
                w.line("return True")
            else:
                without = f"not ({match_test('i', mask)}) or " if mask else ""
                w.line(f"return {without}V[i, {self.matcher.column(self.bodies, language.Mobile)}] != 0.0")
        return w.text()

    def hit_wall(self) -> str:
        """What a wall does to a body by the world's rule; without a rule, the wall stops the body."""
        with self.source.function("hit_wall(V, bits, P, err, i, n0, n1)") as w, self._noting(w, ("i",)):
            if self.world.wall_contact is None:
                for c in (0, 1):
                    with w.block(f"if n{c} != 0.0:"):
                        w.line(f"V[i, VX + {c}] = 0.0")
            else:
                self._exchange(w, self.world.wall_contact, ("i",))
        return w.text()

    def hit_body(self) -> str:
        """What two bodies do to each other."""
        with self.source.function("hit_body(V, bits, P, err, i, j)") as w, self._noting(w, ("i", "j")):
            if self.world.pair_contact is not None:
                self._exchange(w, self.world.pair_contact, ("i", "j"))
        return w.text()

    def may_touch(self) -> str:
        """Whether some body may reach through a wall or another body; a cheap test without roots."""

        def matching(slot: language.Slot) -> int | None:
            return self.matcher.match(Group((0,), slot.types, False), COLLIDES)

        with self.source.function("may_touch(V, bits, kind, hull_radius)", inline=True) as w:
            groups = self.matcher.merge(matching)
            colliders = [(g, m) for g in groups if (m := self.matcher.match(g, COLLIDES)) is not None]
            for n, (group, mask) in enumerate(colliders):
                with over_group(w, group, "i"), condition(w, match_test("i", mask)):
                    w.line("ri = 0.5 * V[i, SIZE] if kind[i] == 1 else hull_radius[i]")
                    w.line("ix, iy = V[i, X], V[i, X + 1]")
                    with w.block("if abs(ix) + ri > HIGH or abs(iy) + ri > HIGH:"):
                        w.line("return True")
                    for other, other_mask in colliders[n:] if self.world.pair_contact is not None else []:
                        if other is not group or not group.is_single:
                            self._pair_test(w, other is group, other, other_mask)
            w.line("return False")
        return w.text()

    def _pair_test(self, w: Writer, same: bool, other: Group, mask: int) -> None:
        with over_group(w, other, "j"), condition(w, both("j > i" if same else "", match_test("j", mask))):
            w.line("reach = ri + (0.5 * V[j, SIZE] if kind[j] == 1 else hull_radius[j]) + THRESHOLD")
            w.line("jx, jy = V[j, X] - ix, V[j, X + 1] - iy")
            with w.block("if jx * jx + jy * jy <= reach * reach:"):
                w.line("return True")

    def _mask(self, needs: language.Pattern) -> int | None:
        """The mask that a body must have to match; None where no body matches."""
        return self.matcher.match(self.bodies, needs) if self.bodies.types else None

    @contextmanager
    def _noting(self, w: Writer, bodies: tuple[str, ...]) -> Iterator[None]:
        """A context around the exchange of velocities: the rules of ``on_contact`` read before it and write after it."""
        self.source.write_parameters(w)
        if not self.bodies.types:
            yield
            return
        w.groups = dict.fromkeys(bodies, self.bodies)
        mine = [(self.rules.index(r), r) for r in self.world.on_contact if len(r.needs) == len(bodies)]
        notes = ContactNotes(self.matcher, self.bodies, bodies, mine)
        notes.gather(w)
        yield
        notes.write(w)

    def _exchange(self, w: Writer, rule: language.Rule, variables: tuple[str, ...]) -> None:
        """Run a contact rule on given bodies and set all its factors at once."""
        self._check_exchange(rule, len(variables))
        if not self.bodies.types:
            return

        def write_leaf(leaf: language.Leaf) -> None:
            stores = []
            for e in leaf.effects:
                column = self.matcher.column(self.bodies, e.factor)
                for c, component in enumerate(e.components, column):
                    stores.append(f"V[{variables[e.argument]}, {c}] = {w.value(bind(component, variables, 0))}")
            for store in stores:
                w.line(store)

        w.line(f"# {rule.name}")
        w.groups = dict.fromkeys(variables, self.bodies)
        tests = [match_test(v, self._mask(n) or 0) for v, n in zip(variables, rule.needs, strict=True)]
        with condition(w, both(*tests)):
            write_tree(w, rule.tree, variables, 0, write_leaf)

    def _check_exchange(self, rule: language.Rule, bodies: int) -> None:
        check_contact_rule(rule)
        if rule.relation is not None:
            raise RuleError(f"{rule.where}: a contact rule cannot have a relation; test inside the rule")
        if len(rule.needs) != bodies:
            raise RuleError(f"{rule.where}: this contact rule must take {bodies} entities, not {len(rule.needs)}")
        if any(e.kind is not language.SetFactor for e in language.effects_of(rule.tree)):
            raise RuleError(f"{rule.where}: a contact happens at an instant, so it can only return SetFactor")
        for need in rule.needs if self.bodies.types else ():
            if self._mask(need) is None:
                missing = [f.__name__ for f in need.factors if self._mask(language.Pattern((f,))) is None]
                raise RuleError(f"{rule.where}: no body that collides has {', '.join(missing)}")
