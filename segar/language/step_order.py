"""The order of a step: its stages, the rules that run in each, and the effects of these rules that count there.

The kernel's source is generated from this order, and the interpreter runs by it. A step applies :data:`ACT` once, then
sub-steps; each sub-step goes through :data:`SUB_STEP`. In a stage, all rules read the state from before the stage, and
their effects are written when all of them have been evaluated.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from enum import Enum

from segar.language.effects import Differential, Effect
from segar.language.factors import Factor, Position, Velocity
from segar.language.rule_definition import Rule
from segar.language.task import TaskFunctions
from segar.language.world import WorldRules

Counts = Callable[[Rule, type[Effect], type[Factor]], bool]
"""Whether a rule's effect of this kind on this factor counts in a stage."""


class Operation(Enum):
    """What a stage does."""

    APPLY_EFFECTS = "write the effects of the rules to the state"
    FIND_RATES = "add up the differentials on each position, without changing the state"
    MOVE = "change each position by its rate times the time step"
    RESOLVE_CONTACTS = "go back to each contact with a wall or a body, exchange velocities there, and go on"


@dataclass(frozen=True)
class Stage:
    """One stage of a step.

    Attributes:
        name: names the stage in the kernel's source, and where the interpreter reports which rules fired.
        counts: which effects of the stage's rules count in it; the others are ignored there.
        rules: the rules that the stage evaluates, of a world and a task.
        scales: whether differentials are multiplied by the time step.
    """

    name: str
    operation: Operation
    counts: Counts = lambda rule, kind, factor: True
    rules: Callable[[WorldRules, TaskFunctions], Sequence[Rule]] = lambda world, task: world.rules
    scales: bool = True


def moves(rule: Rule, kind: type[Effect], factor: type[Factor]) -> bool:
    """Whether the effect is on a position."""
    return issubclass(factor, Position)


def _sets_position(rule: Rule, kind: type[Effect], factor: type[Factor]) -> bool:
    return issubclass(factor, Position) and kind is not Differential


def _changes_velocity(rule: Rule, kind: type[Effect], factor: type[Factor]) -> bool:
    """Effects on velocities, and all effects of a rule that is checked again, except those on positions."""
    return not issubclass(factor, Position) and (rule.recheck or issubclass(factor, Velocity))


def _changes_other_factor(rule: Rule, kind: type[Effect], factor: type[Factor]) -> bool:
    """Effects on all factors but velocity and position, and all of a checked rule's, except those on positions."""
    return not issubclass(factor, Position) and (rule.recheck or not issubclass(factor, Velocity))


ACT = Stage("act", Operation.APPLY_EFFECTS, rules=lambda world, task: task.act, scales=False)
"""The task's action: once per step, before the first sub-step."""

FIND_RATES = Stage("position", Operation.FIND_RATES, moves)
"""The rates of all positions; contacts find them again after each exchange of velocities."""

SUB_STEP = (
    Stage("factors", Operation.APPLY_EFFECTS, _changes_other_factor),
    Stage("velocity", Operation.APPLY_EFFECTS, _changes_velocity),
    Stage("limit", Operation.APPLY_EFFECTS, rules=lambda world, task: () if world.limit is None else (world.limit,)),
    FIND_RATES,
    Stage("position", Operation.APPLY_EFFECTS, _sets_position),
    Stage("position", Operation.MOVE),
    Stage("contact", Operation.RESOLVE_CONTACTS),
)
"""The stages of a sub-step, in order. After the last one, the task's ``terminated`` is evaluated."""
