"""Contacts -> source: who is solid, what a wall and another body do, and the test that they may touch at all."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass

from segar.engine.compiler.checks import check_contact_rule
from segar.engine.compiler.contact_notes import ContactNotes
from segar.engine.compiler.emit import Writer, bind
from segar.engine.compiler.loops import both, condition, match_test, over_group
from segar.engine.compiler.source import Source, write_value
from segar.engine.compiler.spec import Group, Matcher, Needs, needs_of
from segar.errors import RuleError
from segar.language import Branch, Collides, Mobile, Position, Rule, SetFactor, Slot, Tree, Velocity, WorldRules

COLLIDES = Needs((Collides, Position, Velocity), None)


@dataclass(frozen=True)
class Contacts:
    """The functions that ``device_contacts.py`` calls by name while it resolves contacts."""

    source: Source
    world: WorldRules
    rules: list[Rule]

    @property
    def matcher(self) -> Matcher:
        return self.source.matcher

    def solid(self) -> str:
        """Whether a body takes part in collisions of pairs."""
        with self.source.function("solid(V, bits, i)") as w:
            rule = self.world.solid
            if self.world.pair_contact is None or rule is None:
                w.line(f"return {self.world.pair_contact is not None}")
            else:
                check_contact_rule(rule)
                if rule.signature.parameters:
                    raise RuleError(f"{rule.where}: what is solid cannot depend on world parameters")
                self._return_value(w, rule)
        return w.text()

    def movable(self) -> str:
        """Whether a contact may push a body."""
        with self.source.function("movable(V, bits, i)") as w:
            group = self._colliders()
            mask = None if group is None else self.matcher.match(group, Needs((Mobile,), None))
            if group is None or mask is None:
                w.line("return True")
            else:
                column = self.matcher.column(group, Mobile)
                lacks = f"not ({match_test('i', mask)}) or " if mask else ""
                w.line(f"return {lacks}V[i, {column}] != 0.0")
        return w.text()

    def hit_wall(self) -> str:
        """What a wall does to a body, as the world says; without a word from it, the wall stops the body."""
        with self.source.function("hit_wall(V, bits, P, err, i, n0, n1)") as w, self._noting(w, ("i",)):
            if self.world.wall_contact is None:
                for c in (0, 1):
                    with w.block(f"if n{c} != 0.0:"):
                        w.line(f"V[i, VX + {c}] = 0.0")
            else:
                w.line(f"# {self.world.wall_contact.name}")
                self._assign(w, self.world.wall_contact, ("i",))
        return w.text()

    def hit_body(self) -> str:
        """What two bodies do to each other."""
        with self.source.function("hit_body(V, bits, P, err, i, j)") as w, self._noting(w, ("i", "j")):
            if self.world.pair_contact is None:
                w.line("pass")
            else:
                w.line(f"# {self.world.pair_contact.name}")
                self._assign(w, self.world.pair_contact, ("i", "j"))
        return w.text()

    @contextmanager
    def _noting(self, w: Writer, bodies: tuple[str, ...]) -> Iterator[None]:
        """Around the exchange: what the rules of ``on_contact`` make of the bodies as they meet, written afterwards."""
        self.source.write_parameters(w)
        group = self._colliders()
        if group is None:
            yield
            return
        w.groups = dict.fromkeys(bodies, group)
        mine = [(self.rules.index(r), r) for r in self.world.on_contact if len(needs_of(r)) == len(bodies)]
        notes = ContactNotes(self.matcher, group, bodies, mine)
        notes.gather(w)
        yield
        notes.write(w)

    def may_touch(self) -> str:
        """Whether some body may reach through a wall or another body; a cheap test without roots."""
        with self.source.function("may_touch(V, bits, kind, hull_radius)", inline=True) as w:
            groups = self.matcher.merge(range(len(self.source.layout.slots)), self._collider_key)
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

    def _collider_key(self, slot: Slot) -> tuple:
        return (self.matcher.match(Group((0,), slot.types, False), COLLIDES),)

    def _pair_test(self, w: Writer, same: bool, other: Group, mask: int) -> None:
        with over_group(w, other, "j"), condition(w, both("j > i" if same else "", match_test("j", mask))):
            w.line("reach = ri + (0.5 * V[j, SIZE] if kind[j] == 1 else hull_radius[j]) + THRESHOLD")
            w.line("jx, jy = V[j, X] - ix, V[j, X + 1] - iy")
            with w.block("if jx * jx + jy * jy <= reach * reach:"):
                w.line("return True")

    def _assign(self, w: Writer, rule: Rule, variables: tuple[str, ...]) -> None:
        """Run a contact rule on given bodies and set what it says, all at once."""
        check_contact_rule(rule)
        if rule.relation is not None:
            raise RuleError(f"{rule.where}: a contact rule cannot have a relation; test inside the rule")
        group = self._colliders()
        if group is None:
            w.line("pass")
            return
        needs = needs_of(rule)
        if len(needs) != len(variables):
            raise RuleError(f"{rule.where}: this contact rule must take {len(variables)} entities, not {len(needs)}")
        for need in needs:
            if self.matcher.match(group, need) is None:
                lacking = [f.__name__ for f in need.factors if self.matcher.match(group, Needs((f,), None)) is None]
                raise RuleError(f"{rule.where}: no body that collides has {', '.join(lacking)}")
        w.groups = dict.fromkeys(variables, group)
        tests = [match_test(v, self.matcher.match(group, n) or 0) for v, n in zip(variables, needs, strict=True)]
        with condition(w, both(*tests)):
            self._assign_tree(w, rule, rule.tree, variables, group)

    def _assign_tree(self, w: Writer, rule: Rule, tree: Tree, variables: tuple[str, ...], group: Group) -> None:
        if isinstance(tree, Branch):
            with w.block(f"if {w.value(bind(tree.condition, variables, 0))}:"):
                self._assign_tree(w, rule, tree.yes, variables, group)
            with w.block("else:"):
                self._assign_tree(w, rule, tree.no, variables, group)
            return
        stores = []
        for o in tree.outcomes:
            if o.kind is not SetFactor:
                raise RuleError(f"{rule.where}: a contact happens at an instant, so it can only return SetFactor")
            column = self.matcher.column(group, o.factor)
            for c, component in enumerate(o.components):
                stores.append(f"V[{variables[o.argument]}, {column + c}] = {w.value(bind(component, variables, 0))}")
        for store in stores:
            w.line(store)

    def _return_value(self, w: Writer, rule: Rule) -> None:
        """Return a truth-valued function of entity ``i``, which is any body that collides."""
        group = self._colliders()
        mask = None if group is None else self.matcher.match(group, needs_of(rule)[0])
        if group is None or mask is None:
            w.line("return True")
            return
        w.groups = {"i": group}
        w.line(f"# {rule.name}")
        w.line("total = True")
        with condition(w, match_test("i", mask)):
            write_value(w, rule.tree, ("i",), "total = {}")
        w.line("return total")

    def _colliders(self) -> Group | None:
        """All that collides, as one group: contacts find their bodies by index, not by loop."""
        groups = [g for g in self.matcher.groups if self.matcher.match(g, COLLIDES) is not None]
        if not groups:
            return None
        types = tuple(dict.fromkeys(t for g in groups for t in g.types))
        return Group(tuple(range(len(self.source.layout.slots))), types, False)
