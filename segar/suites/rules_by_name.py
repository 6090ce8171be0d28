"""The rules that suites name, so that a suite is data and runs no code of its own."""

from collections.abc import Callable, Mapping
from functools import cache

from segar.noise import Choice
from segar.rules import DEFAULT_RULES, RuleSpace, World, apply_friction, record_drag, templates
from segar.tasks import remembering_world

STILL = (1.0, 0.0)  # probabilities of none and one active option


def _dynamics(by: str, part: str) -> Callable[[], World]:
    return lambda: World(templates.dynamics_space().split(part, by))


def _drifting_goal(active: int | Choice, *speeds: float) -> Callable[[], World]:
    return lambda: World(RuleSpace([templates.drifting("drifting_goal", speed=Choice(speeds))], active=active))


_MAKERS: Mapping[str, Callable[[], World] | None] = {
    "default": None,
    "default, and the ball remembers": remembering_world,
    "without friction": lambda: World([rule for rule in DEFAULT_RULES if rule not in (apply_friction, record_drag)]),
    **{f"dynamics, {by}, {part}": _dynamics(by, part) for by in ("combinations", "rules", "constants")
       for part in ("train", "test")},
    "goal drifts slowly": _drifting_goal(1, -0.1, -0.05, 0.05, 0.1),
    "goal drifts fast": _drifting_goal(1, -0.4, -0.3, 0.3, 0.4),
    "goal may drift, and stays": _drifting_goal(Choice([0, 1], STILL), -0.3, -0.2, 0.2, 0.3),
    "goal may drift, and does": _drifting_goal(1, -0.3, -0.2, 0.2, 0.3),
}  # fmt: skip

RULES: tuple[str, ...] = tuple(_MAKERS)
"""The names of rules that a suite's file can have."""


@cache
def rules_of(name: str) -> World | None:
    """The world of that name; None for the default rules."""
    make = _MAKERS[name]
    return None if make is None else make()
