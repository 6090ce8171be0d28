"""The built-in rules, plain typed functions, and the world that they make: no numba, no engine."""

from segar.rules import templates
from segar.rules.collisions import bounce, collide, is_solid
from segar.rules.constants import constant
from segar.rules.default_rules import DEFAULT_RULES
from segar.rules.fields import lorentz_law, lorentz_law_r2
from segar.rules.friction import apply_friction, come_to_rest, record_drag
from segar.rules.heat import apply_burn
from segar.rules.holes import consume
from segar.rules.motion import accelerate, kill_condition, move, speed_limit, stop_condition
from segar.rules.rule_option import RuleOption
from segar.rules.rule_space import RuleSpace
from segar.rules.world import World

__all__ = [
    "DEFAULT_RULES", "RuleOption", "RuleSpace", "World", "accelerate", "apply_burn", "apply_friction", "bounce",
    "collide", "come_to_rest", "constant", "consume", "is_solid", "kill_condition", "lorentz_law", "lorentz_law_r2",
    "move", "record_drag", "speed_limit", "stop_condition", "templates",
]  # fmt: skip
