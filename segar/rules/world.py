"""A world: the rules of motion and contact that hold in it."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any

from segar.errors import RuleError
from segar.language import ARENA, Rule, SetFactor, Velocity, as_rule
from segar.rules.collisions import bounce, collide, is_solid
from segar.rules.default_rules import DEFAULT_RULES
from segar.rules.motion import speed_limit
from segar.rules.rule_option import RuleOption
from segar.rules.rule_space import RuleSpace
from segar.support import ShownInNotebooks


@dataclass(frozen=True, init=False)
class World(ShownInNotebooks):
    """Rules, and the contact rules that run after positions changed.

    Args:
        rules: rules or undecorated typed functions, which replace the default ones; or a :class:`RuleSpace`, which says of
            each level which of its rules hold.
        limit: applied to velocities after all other rules of velocity; None for no limit, where fast bodies can pass through
            others unseen.
        wall_contact: what a wall does to a body that touches it; None: bodies stop there.
        pair_contact: what two bodies do to each other when they touch; None: bodies pass through each other.
        solid: which bodies take part in pair contacts.
        on_contact: rules that note a contact: on two bodies that touch, in both orders, or on one body and the ``Wall``
            that it touches. They see the state in which the bodies meet; what they set holds after the exchange.

        walls: distance of the arena's walls from its middle [m]. Level distributions place things in an arena of 1;
            in another, levels are made by hand (:meth:`segar.Levels.from_entities`).
        space: the rule space that the rules are of; follows from ``rules``.

    Raises:
        RuleError: a rule cannot be traced, is in its sequence twice, or does not suit its place.
    """

    rules: tuple[Rule, ...]
    limit: Rule | None
    wall_contact: Rule | None
    pair_contact: Rule | None
    solid: Rule | None
    on_contact: tuple[Rule, ...]
    walls: float
    space: RuleSpace | None

    def __init__(
        self,
        rules: Sequence[Any] | RuleSpace = DEFAULT_RULES,
        limit: Any = speed_limit,
        wall_contact: Any = bounce,
        pair_contact: Any = collide,
        solid: Rule | None = is_solid,
        on_contact: Sequence[Any] = (),
        walls: float = ARENA,
        space: RuleSpace | None = None,
    ) -> None:
        set_ = object.__setattr__
        given = rules.rules if isinstance(rules, RuleSpace) else _as_rules("rules", rules)
        was_of = () if space is None else space.on_contact  # dataclasses.replace gives all fields again
        notes = [rule for rule in _as_rules("on_contact", on_contact) if rule not in was_of]
        space = rules if isinstance(rules, RuleSpace) else space if space is not None and given == space.rules else None
        set_(self, "space", space)
        set_(self, "rules", given)
        set_(self, "on_contact", (*notes, *(() if space is None else space.on_contact)))
        for name, one in (("limit", limit), ("wall_contact", wall_contact), ("pair_contact", pair_contact)):
            rule = None if one is None else as_rule(one)
            if rule is not None and rule.active is not None:
                raise RuleError(f"{rule.where}: {name} holds in every level; test the parameter inside the rule")
            set_(self, name, rule)
        set_(self, "solid", solid)
        set_(self, "walls", float(walls))
        if not 0.0 < self.walls < float("inf"):
            raise RuleError(f"World(walls={walls!r}): the distance of the walls must be a finite number above 0")
        if self.limit is not None and not all(issubclass(f, Velocity) for f in self.limit.changes):
            raise RuleError(f"{self.limit.where}: the limit may only set Velocity")
        for rule in self.on_contact:
            _check_note(rule, self.pair_contact)

    def may_meet(self, one: Rule, other: Rule) -> bool:
        """Whether both rules hold in some level."""
        return self.space is None or self.space.may_meet(one.active, other.active)


def _as_rules(name: str, rules: Sequence[Any]) -> tuple[Rule, ...]:
    """The rules of a sequence of rules and typed functions."""
    if callable(rules):
        raise RuleError(f"{name} must be a sequence of rules, not {rules!r}; write ({rules!r},)")
    if isinstance(rules, (str, set, frozenset, RuleOption)) or not isinstance(rules, Iterable):
        raise RuleError(f"{name} must be a sequence of rules, or a RuleSpace, not {rules!r}")
    rules = tuple(rules)
    for one in rules:
        if isinstance(one, (RuleOption, RuleSpace)):
            raise RuleError(
                f"{name} lists {one!r}; options belong to a RuleSpace([...]), which stands in place of a list"
            )
    made = tuple(as_rule(r) for r in rules)
    for rule in made:
        if sum(r is rule for r in made) > 1:
            raise RuleError(f"{rule.where} stands in {'the rules' if name == 'rules' else name} twice")
    return made


def _check_note(rule: Rule, pair_contact: Rule | None) -> None:
    """Raise :class:`RuleError` where a rule does not suit ``on_contact``."""
    bodies, takes_wall = len(rule.signature.entities), rule.signature.uses("wall")
    if bodies != (1 if takes_wall else 2):
        raise RuleError(
            f"{rule.where}: a rule of on_contact takes two entities that touch, or one and the Wall that it touches"
        )
    if bodies == 2 and pair_contact is None:
        raise RuleError(f"{rule.where}: bodies pass through each other without a pair_contact, so they never touch")
    if rule.relation is not None:
        raise RuleError(f"{rule.where}: a contact rule cannot have a relation; test inside the rule")
    if any(effect is not SetFactor for effect, _ in rule.signature.effects):
        raise RuleError(f"{rule.where}: a contact happens at an instant, so it can only return SetFactor")
