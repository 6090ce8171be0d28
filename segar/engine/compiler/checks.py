"""Errors when a kernel is made: a rule needs something that the layout, the task or its place in the world lacks."""

from segar.engine.compiler.emit import MATHEMATICS, VARIABLES
from segar.errors import RuleError, did_you_mean
from segar.language import Action, Layout, Order, Parameter, Position, Relation, Rule, Size, Velocity, holds, symbols_of

MOST_DRAWS = 256  # of a rule; the next ones would be those of the rule behind it
MOST_OPERATIONS = 10_000  # of a rule, which compile in two minutes
COST_OF_A_FUNCTION = 30  # operations that take as long to compile as a call of an elementary function


def check_rule(rule: Rule, layout: Layout, numbers: int, allows_action: bool, allows_wall: bool) -> None:
    """Raise :class:`RuleError` where a rule takes something that its place does not have.

    Args:
        numbers: how many numbers the task's action has.
    """
    if len(rule.signature.entities) > len(VARIABLES):
        raise RuleError(f"{rule.where}: a rule can involve at most {len(VARIABLES)} entities")
    for parameter in (*rule.parameters, *_relation_parameters(rule.relation)):
        if parameter not in layout.parameters:
            names = [p.__name__ for p in layout.parameters]
            raise RuleError(
                f"{rule.where}: no value is known for the world parameter {parameter.__name__}; give it in the"
                f" distribution's 'parameters'.{did_you_mean(parameter.__name__, names)}"
            )
    if rule.signature.uses("action") and not allows_action:
        raise RuleError(f"{rule.where}: only a task's action and reward can take {Action.__name__}")
    if rule.signature.uses("wall") and not allows_wall:
        raise RuleError(f"{rule.where}: only World(wall_contact=...) can take Wall, and rules of on_contact")
    symbols = symbols_of(rule.tree)
    cost = sum(COST_OF_A_FUNCTION if symbol.op in MATHEMATICS else symbol.op != "const" for symbol in symbols)
    if cost > MOST_OPERATIONS:
        raise RuleError(
            f"{rule.where}: has {cost:,} operations where its loops are written out, and a kernel takes at most"
            f" {MOST_OPERATIONS:,} of a rule (an elementary function counts as {COST_OF_A_FUNCTION}); take fewer steps, or one"
            " step in each sub-step, with a factor that holds what was reached"
        )
    for number in (s.args[0] for s in symbols if s.op == "action" and not 0 <= s.args[0] < numbers):
        raise RuleError(f"{rule.where}: takes action[{number}], but the task's action has {numbers} numbers")
    if any(s.op == "draw" and s.args[0] >= MOST_DRAWS for s in symbols):
        raise RuleError(f"{rule.where}: draws more than {MOST_DRAWS} random numbers; make two rules of it")


def check_contact_rule(rule: Rule) -> None:
    """Raise :class:`RuleError` where a rule that contacts call needs more than one or two bodies and parameters."""
    refusal = f"{rule.where}: rules of position and of contacts, and what is solid, cannot"
    symbols = symbols_of(rule.tree)
    if any(s.op == "relation" and isinstance(s.args[0], str) for s in symbols):
        raise RuleError(f"{refusal} ask is_on, overlaps or contains")
    if any(s.op == "draw" for s in symbols):
        raise RuleError(f"{refusal} draw random numbers")


def check_position_rule(rule: Rule) -> None:
    """Raise :class:`RuleError` where a rule that moves things, which contacts call again, is not one for contacts."""
    if rule.relation is not None:
        raise RuleError(f"{rule.where}: a rule that moves things cannot have a relation; test inside the rule")
    check_contact_rule(rule)


def check_geometry(layout: Layout) -> None:
    """Raise :class:`RuleError` where an entity has a sub-class of a factor whose own column geometry and contacts read."""
    for kind in layout.types:
        for factor in (Position, Velocity, Size, Order):
            held = holds(kind, factor)
            if held not in (None, factor):
                raise RuleError(
                    f"entity {kind.__name__} holds {held.__name__} in place of {factor.__name__}; let it hold"
                    f" {factor.__name__} itself, which geometry and contacts use"
                )


def _relation_parameters(relation: Relation | None) -> list[type[Parameter]]:
    """World parameters that a relation or its parts take."""
    if relation is None:
        return []
    return [*relation.signature.parameters, *(p for part in relation.parts for p in _relation_parameters(part))]
