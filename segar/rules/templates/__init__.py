"""Templates: functions that make options of a rule space, plain typed functions with constants; and the built-in space."""

from segar.rules.templates.changes import contagion, growth, sharing, unlocking
from segar.rules.templates.dynamics import dynamics_space
from segar.rules.templates.forces import (
    anchor_spring,
    central_force,
    drag,
    magnetic_field,
    pair_spring,
    rotating_field,
    uniform_field,
)
from segar.rules.templates.places import drifting, hiding, one_way_wall, portal, switch

__all__ = [
    "anchor_spring", "central_force", "contagion", "drag", "drifting", "dynamics_space", "growth", "hiding",
    "magnetic_field", "one_way_wall", "pair_spring", "portal", "rotating_field", "sharing", "switch", "uniform_field",
    "unlocking",
]  # fmt: skip
