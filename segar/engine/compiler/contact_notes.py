"""Rules of ``on_contact`` -> source: they note a contact, such as a count, an infection or wear.

All of them read the state in which the bodies meet. Their values are gathered in local names, as in a stage, and written
after the exchange of velocities.
"""

from dataclasses import dataclass
from itertools import permutations

from segar.engine.compiler.checks import check_contact_rule
from segar.engine.compiler.emit import Writer, bind
from segar.engine.compiler.loops import both, condition, match_test
from segar.engine.compiler.set_factors import FactorSetting
from segar.engine.compiler.source import write_tree
from segar.engine.compiler.spec import Group, Matcher
from segar.language import EffectExpression, Leaf, Pattern, Rule, effects_of, holds


@dataclass(frozen=True)
class _Note:
    """A rule with its number, and of each argument the mask and the types of the bodies that match it."""

    rule: Rule
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

    def __init__(self, matcher: Matcher, group: Group, bodies: tuple[str, ...], rules: list[tuple[int, Rule]]) -> None:
        self.matcher, self.group, self.bodies = matcher, group, bodies
        self.notes = [n for n in (self._note(number, rule) for number, rule in rules) if n is not None]
        orders = list(permutations(bodies))
        settings = [self._setting(n, e, o) for n in self.notes for e in effects_of(n.rule.tree) for o in orders]
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
                with condition(w, both(*tests)):
                    self._write_effects(w, note, order)

    def write(self, w: Writer) -> None:
        """Set the factors."""
        for setting in self.settings:
            setting.report_conflict(w)
            with w.block(f"if {setting.is_set}:"):
                setting.store(w)

    def _note(self, number: int, rule: Rule) -> _Note | None:
        check_contact_rule(rule)
        masks = [self.matcher.match(self.group, need) for need in rule.needs]
        if None in masks:
            return None
        return _Note(rule, number, tuple(m or 0 for m in masks), tuple(map(self._matching, rule.needs)))

    def _matching(self, needs: Pattern) -> Group:
        """The group with only those types that match, since these decide about columns."""
        kinds = [t for t in self.group.types if needs.entity_type is None or issubclass(t, needs.entity_type)]
        kinds = [t for t in kinds if all(holds(t, f) is not None for f in needs.factors)]
        return Group(self.group.slots, tuple(kinds), self.group.optional)

    def _setting(self, note: _Note, effect: EffectExpression, order: tuple[str, ...]) -> FactorSetting:
        column = self.matcher.column(note.groups[effect.argument], effect.factor)
        return FactorSetting(order[effect.argument], column, effect.factor.width)

    def _write_effects(self, w: Writer, note: _Note, order: tuple[str, ...]) -> None:
        def write_leaf(leaf: Leaf) -> None:
            for effect in leaf.effects:
                values = [w.value(bind(component, order, note.number)) for component in effect.components]
                self._setting(note, effect, order).add(w, note.number, note.rule.priority, values)

        write_tree(w, note.rule.tree, order, note.number, write_leaf)
