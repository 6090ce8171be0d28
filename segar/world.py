"""A world: the rules of motion and contact that hold in it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from segar.errors import RuleError
from segar.factors import Velocity
from segar.rule import Rule, as_rule
from segar.rules import DEFAULT_RULES, bounce, collide, is_solid, speed_limit


@dataclass(frozen=True, init=False)
class World:
    """Rules, and the contact rules that run after positions changed.

    Args:
        rules: rules or undecorated typed functions; they replace the default ones.
        limit: applied to velocities after all other rules of velocity; None for no limit.
        wall_contact: what a wall does to a body that touches it; None: bodies stop there.
        pair_contact: what two bodies do to each other when they touch; None: bodies pass through each other.
        solid: which bodies take part in pair contacts.

    Raises:
        RuleError: a rule cannot be understood, or stands in the sequence twice.
    """

    rules: tuple[Rule, ...]
    limit: Rule | None
    wall_contact: Rule | None
    pair_contact: Rule | None
    solid: Rule | None

    def __init__(
        self,
        rules: Sequence[Any] = DEFAULT_RULES,
        limit: Any = speed_limit,
        wall_contact: Any = bounce,
        pair_contact: Any = collide,
        solid: Rule | None = is_solid,
    ) -> None:
        if callable(rules):
            raise RuleError(f"rules must be a sequence of rules, not {rules!r}; write ({rules!r},)")
        made = tuple(as_rule(r) for r in rules)
        for rule in made:
            if sum(r is rule for r in made) > 1:
                raise RuleError(f"{rule.where} stands in the rules twice")
        set_ = object.__setattr__
        set_(self, "rules", made)
        set_(self, "limit", None if limit is None else as_rule(limit))
        set_(self, "wall_contact", None if wall_contact is None else as_rule(wall_contact))
        set_(self, "pair_contact", None if pair_contact is None else as_rule(pair_contact))
        set_(self, "solid", solid)
        if self.limit is not None and not all(issubclass(f, Velocity) for f in self.limit.changes):
            raise RuleError(f"{self.limit.where}: the limit may only set Velocity")
