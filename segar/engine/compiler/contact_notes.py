"""What rules note about a contact -> source: a count, a touch that infects, an impact that wears something out.

All of them read the state in which the bodies meet. What they set is gathered in locals, as in a stage, and written
after the exchange of velocities.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import permutations

from segar.engine.compiler.checks import check_contact_rule
from segar.engine.compiler.emit import Writer, bind
from segar.engine.compiler.loops import both, condition, match_test
from segar.engine.compiler.spec import Group, Matcher, Needs, needs_of, outcomes_of
from segar.language import Branch, Outcome, Rule, Tree, holds


@dataclass(frozen=True)
class _Noted:
    """A rule with its number, and of each argument the mask and the types of the bodies that match it."""

    rule: Rule
    number: int
    masks: tuple[int, ...]
    groups: tuple[Group, ...]


class ContactNotes:
    """Writes the source for the bodies of one contact.

    Args:
        group: all that collides; rules whose arguments none of it matches are left out.
        bodies: the variables that hold the bodies; a rule on two applies in both orders.
        rules: rules on that many bodies, with their numbers in the world.
    """

    def __init__(self, matcher: Matcher, group: Group, bodies: tuple[str, ...], rules: list[tuple[int, Rule]]) -> None:
        self.matcher, self.group, self.bodies = matcher, group, bodies
        self.noted = [n for n in (self._note(number, rule) for number, rule in rules) if n is not None]

    def gather(self, w: Writer) -> None:
        """Ask every rule, in every order of the bodies."""
        for body, column, width in self._targets():
            w.line(f"set_{body}_{column} = by_{body}_{column} = rival_{body}_{column} = -1")
            for c in range(column, column + width):
                w.line(f"sx_{body}_{c} = 0.0")
        for noted in self.noted:
            for order in permutations(self.bodies):
                w.line(f"# {noted.rule.name}")
                w.groups = dict(zip(order, noted.groups, strict=True))
                tests = [match_test(body, mask) for body, mask in zip(order, noted.masks, strict=True)]
                with condition(w, both(*tests)):
                    self._write_tree(w, noted, noted.rule.tree, order)

    def write(self, w: Writer) -> None:
        """Set what the rules said."""
        for body, column, width in self._targets():
            place = f"{body}_{column}"
            with w.block(f"if rival_{place} >= 0:"):
                w.line(f"err[0], err[1], err[2], err[3], err[4] = 1, {body}, {column}, by_{place}, rival_{place}")
            with w.block(f"if set_{place} >= 0:"):
                for c in range(column, column + width):
                    w.line(f"V[{body}, {c}] = sx_{body}_{c}")

    def _note(self, number: int, rule: Rule) -> _Noted | None:
        check_contact_rule(rule)
        needs = needs_of(rule)
        masks = [self.matcher.match(self.group, need) for need in needs]
        if None in masks:
            return None
        return _Noted(rule, number, tuple(m or 0 for m in masks), tuple(map(self._matching, needs)))

    def _matching(self, needs: Needs) -> Group:
        """The group with those types alone that match, which decide about columns."""
        kinds = [t for t in self.group.types if needs.entity_type is None or issubclass(t, needs.entity_type)]
        kinds = [t for t in kinds if all(holds(t, f) is not None for f in needs.factors)]
        return Group(self.group.slots, tuple(kinds), self.group.optional)

    def _targets(self) -> list[tuple[str, int, int]]:
        """Body, first column and width of all that some rule may set."""
        found = [
            (order[o.argument], self._column(noted, o), o.factor.width)  # type: ignore[attr-defined]
            for noted in self.noted
            for o in outcomes_of(noted.rule.tree)
            for order in permutations(self.bodies)
        ]
        return list(dict.fromkeys(found))

    def _write_tree(self, w: Writer, noted: _Noted, tree: Tree, order: tuple[str, ...]) -> None:
        if isinstance(tree, Branch):
            with w.block(f"if {w.value(bind(tree.condition, order, noted.number))}:"):
                self._write_tree(w, noted, tree.yes, order)
            with w.block("else:"):
                self._write_tree(w, noted, tree.no, order)
            return
        for o in tree.outcomes:
            values = [w.value(bind(component, order, noted.number)) for component in o.components]
            self._claim(w, noted, order[o.argument], self._column(noted, o), values)

    def _claim(self, w: Writer, noted: _Noted, body: str, column: int, values: list[str]) -> None:
        """The more specific rule wins; equally specific ones must agree."""
        place, priority = f"{body}_{column}", noted.rule.priority
        with w.block(f"if set_{place} < {priority}:"):
            w.line(f"set_{place}, by_{place}, rival_{place} = {priority}, {noted.number}, -1")
            for c, value in enumerate(values):
                w.line(f"sx_{body}_{column + c} = {value}")
        differs = " or ".join(f"sx_{body}_{column + c} != {value}" for c, value in enumerate(values))
        with w.block(f"elif set_{place} == {priority} and ({differs}):"):
            w.line(f"rival_{place} = {noted.number}")

    def _column(self, noted: _Noted, outcome: Outcome) -> int:
        return self.matcher.column(noted.groups[outcome.argument], outcome.factor)
