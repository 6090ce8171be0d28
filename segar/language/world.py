"""What engine and interpreter need of a world: its rules, without any built-in physics."""

from typing import Protocol

from segar.language.rule_definition import Rule

ARENA = 1.0  # [m] distance of the walls from the middle of the arena that distributions know


class WorldRules(Protocol):
    """The attributes of :class:`segar.World`; see there for their meaning."""

    @property
    def rules(self) -> tuple[Rule, ...]: ...
    @property
    def limit(self) -> Rule | None: ...
    @property
    def wall_contact(self) -> Rule | None: ...
    @property
    def pair_contact(self) -> Rule | None: ...
    @property
    def solid(self) -> Rule | None: ...
    @property
    def on_contact(self) -> tuple[Rule, ...]: ...
    @property
    def walls(self) -> float: ...
    def may_meet(self, one: Rule, other: Rule, /) -> bool: ...


def rules_of(world: WorldRules) -> tuple[Rule, ...]:
    """All rules of a world, in the order that keys their draws: its rules, the limit, those of contacts."""
    single = (world.limit, world.wall_contact, world.pair_contact)
    return (*world.rules, *(rule for rule in single if rule is not None), *world.on_contact)
