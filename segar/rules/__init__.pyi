from . import templates
from .collisions import bounce as bounce, collide as collide
from .constants import constant
from .default_rules import DEFAULT_RULES
from .fields import lorentz_law, lorentz_law_r2 as lorentz_law_r2
from .friction import apply_friction, come_to_rest as come_to_rest, record_drag
from .heat import apply_burn as apply_burn
from .holes import consume as consume
from .motion import (
    accelerate,
    kill_condition as kill_condition,
    move,
    speed_limit as speed_limit,
    stop_condition as stop_condition,
)
from .rule_option import RuleOption
from .rule_space import RuleSpace
from .world import World

__all__ = [
    "DEFAULT_RULES", "RuleOption", "RuleSpace", "World", "accelerate", "apply_friction", "constant", "lorentz_law",
    "move", "record_drag", "templates",
]  # fmt: skip
