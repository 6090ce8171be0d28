"""The rules of a world that is given none of its own."""

from segar.rules.fields import lorentz_law
from segar.rules.friction import apply_friction, come_to_rest, record_drag
from segar.rules.heat import apply_burn
from segar.rules.holes import consume
from segar.rules.motion import accelerate, kill_condition, move, stop_condition

DEFAULT_RULES = (
    move,
    lorentz_law,
    apply_friction,
    record_drag,
    apply_burn,
    stop_condition,
    kill_condition,
    consume,
    accelerate,
    come_to_rest,
)
