"""A level, its rules, its task and what happened in it, in plain words.

Numbers have six digits; the data of a question have all.
"""

import inspect
import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import Any

import numpy as np

from segar.envs import world_of
from segar.language import (
    CIRCLE,
    HULL,
    Acceleration,
    Drag,
    Factor,
    Framerate,
    Parameter,
    Rule,
    Task,
    matches,
)
from segar.levels import Levels, active_options, rules_in_words
from segar.rules import (
    RuleOption,
    accelerate,
    apply_burn,
    apply_friction,
    bounce,
    collide,
    come_to_rest,
    consume,
    kill_condition,
    lorentz_law,
    move,
    record_drag,
    speed_limit,
    stop_condition,
)
from segar.tasks import GOAL_DISTANCE, IMPULSE, TASKS

FOLLOWING = (Acceleration, Drag)
"""Factors that the built-in rules find anew in every sub-step; they are stated only where a level begins with them."""

RULES: dict[Rule, str] = {
    move: "Position changes by Velocity. A body slower than MinVelocity does not move.",
    accelerate: "Velocity changes by Acceleration, which is the sum of all forces on a body, by its Mass.",
    lorentz_law: (
        "Between any two bodies acts a force q1 q2 / r^2 away from each other, where q1 and q2 are their Charges and r is their"
        " distance [m]. A body with Magnetism b acts on another one of Charge q with a force q b / |w| as well, where w is the"
        " velocity of the other relative to it [m/s]; that force points to the left of w."
    ),
    apply_friction: (
        "Friction acts against the velocity of a body that moves, with the force Gravity x (FloorFriction + Friction of the"
        " topmost tile under the body's centre or rim)."
    ),
    record_drag: "",  # serves the next one
    come_to_rest: "Friction stops a body, and never turns it around.",
    apply_burn: "A mobile body on a tile with Heat loses the share 0.1 x Heat of its Mass in every sub-step.",
    stop_condition: "A body that is not Mobile, or not Alive, does not move.",
    kill_condition: "A body whose Mass is below MinMass dies: its Mass becomes 0, it stops and vanishes.",
    consume: "A mobile body that lies wholly inside a hole is Done: it vanishes and moves no more.",
    speed_limit: "No body is faster than MaxVelocity.",
    bounce: (
        "A wall turns around the component of the velocity that it blocks. It multiplies both components by 1 - WallDamping."
    ),
    collide: (
        "Two bodies that touch collide elastically, along the line of their centres. Before that, each velocity is multiplied"
        " by 1 + StoredEnergy of the other body. Then StoredEnergy becomes 0, unless InfiniteEnergy is 1. A body that is not"
        " Mobile collides as one of 1e8 kg. Bodies that are not Alive, or Done, do not collide."
    ),
}
"""What the built-in rules do, where their docstrings leave out what is needed to compute it."""

PUTTPUTT = (
    "The agent pushes the golfball. An action is two numbers from -1 to 1. At the beginning of a step,"
    f" {IMPULSE:g} x action / Mass [m/s] is added to the golfball's Velocity.",
    f"Success: the centre of the golfball comes within {GOAL_DISTANCE * 8**0.5:.6g} m of the centre of the goal, at the"
    " end of some sub-step. The task is over then, and also where the golfball dies or is Done.",
)
TASK_WORDS: dict[str, tuple[str, str]] = {
    "puttputt": PUTTPUTT,
    "invisiball": (f"{PUTTPUTT[0]} Every action makes the golfball invisible.", PUTTPUTT[1]),
    "billiards": (
        "The agent pushes the cueball. An action is two numbers from -1 to 1. At the beginning of a step,"
        f" {IMPULSE:g} x action / Mass [m/s] is added to the cueball's Velocity.",
        "Success: all other balls are Done or not Alive, and the cueball is neither. The task is over then, and also where the"
        " cueball is Done or dies.",
    ),
}
"""What the agent does, and what success is, in the built-in tasks with their default options."""


def level_in_words(level: Levels, task: Task) -> str:
    """The arena and its time steps, all entities with their factors, and the world parameters of a single level."""
    framerate = parameter_value(level, Framerate)
    walls = world_of(level).walls
    lines = [
        f"The arena is a square. Its walls are {number(walls)} m from its centre, (0, 0).",
        f"A step has {task.sub_steps} sub-steps of {number(1 / framerate)} s each. In a sub-step Velocity changes before"
        " Position, and all else before both.",
        "The Size of a disc is its diameter. Where tiles lie on each other, the one with the lowest Order is on top.",
        "Entities at the beginning:",
    ]
    present = np.flatnonzero(
        level.types[0, :-1] >= 0
    ).tolist()  # the last one is the floor, whose friction is a parameter
    lines += [f"- {entity_in_words(level, slot)}" for slot in present]
    constants = {p: parameter_value(level, p) for p in stated_parameters(level)}
    lines.append(
        "World parameters: " + "; ".join(f"{p.__name__} {with_unit(x, p)}" for p, x in constants.items()) + "."
    )
    return "\n".join(lines)


def entity_in_words(level: Levels, slot: int) -> str:
    """An entity of a single level: type, outline, and all its numbers."""
    layout, values = level.layout, level.values[0, slot]
    kind = layout.types[level.types[0, slot]]
    parts = []
    for factor, column in layout.columns.items():
        value = values[column : column + factor.width]
        if np.isnan(value).any() or (issubclass(factor, FOLLOWING) and not value.any()):
            continue
        parts.append(f"{factor.__name__} {with_unit(value, factor)}")
    return f"{layout.names[slot]} ({kind.__name__}{_outline(level, slot)}): {'; '.join(parts)}"


def rules_of(level: Levels) -> list[str]:
    """The rules that hold in a single level, one text each; those that concern none of its entities are left out."""
    world, space = world_of(level), level.world.space if level.world is not None else None
    types = [level.layout.types[k] for k in level.types[0].tolist() if k >= 0]
    rules = [rule for rule in (*world.rules, *world.on_contact) if rule.active is None]
    rules += [rule for rule in (world.limit, world.wall_contact, world.pair_contact) if rule is not None]
    concern = [r for r in rules if all(any(matches(t, p) for t in types) for p in r.needs)]
    found = [text for rule in concern if (text := rule_in_words(rule))]
    if world.wall_contact is None:
        found.append("A wall stops what touches it.")
    if world.pair_contact is None:
        found.append("Bodies pass through each other.")
    if space is None:
        return found
    active = [option for option, holds_here in zip(space.options, active_options(level)[0], strict=True) if holds_here]
    return [*found, *(_with_details(o, text) for o, text in zip(active, rules_in_words(level, 0), strict=True))]


def option_in_words(option: RuleOption, constants: Mapping[str, float]) -> str:
    """What an option of a rule space does with these constants, by name; the words are those of the level's rules."""
    return _with_details(option, option.words.format(**{name: f"{value:g}" for name, value in constants.items()}))


def rule_in_words(rule: Rule) -> str:
    """What a rule does: of a built-in one its own text, of another one the first sentence of its docstring, else its name."""
    if rule in RULES:
        return RULES[rule]
    return first_sentence(rule.function) or rule.name.replace("_", " ")


def task_in_words(name: str, task: Task) -> str:
    """What the agent can do, and what success is; of own tasks, the first sentences of the docstrings of their functions."""
    if name in TASKS:
        return "\n".join(TASK_WORDS[name])
    low, high = (vector(bound) for bound in (task.action_low, task.action_high))
    functions = task.functions()
    texts = {part: " ".join(map(_said, getattr(functions, part))) for part in ("act", "success", "terminated")}
    size = "one number" if len(task.action_low) == 1 else f"{len(task.action_low)} numbers"
    return "\n".join([
        f"An action is {size} from {low} to {high}. {texts['act']}",
        f"Success: {texts['success'] or 'there is none.'}",
        f"The task is over: {texts['terminated'] or 'never before its last step.'}",
    ])  # fmt: skip


def history_in_words(actions: np.ndarray, states: Sequence[Mapping[str, Any]], units: Mapping[str, str]) -> str:
    """One line for each step: the action, and the state after it.

    Args:
        actions: one for each step, float ``(steps, action size)``.
        states: entity to factor to its value, a number or two, after each step.
        units: of the factors.
    """
    return "\n".join(
        f"step {step}: action {vector(action)}; " + "; ".join(_entities_in_words(state, units))
        for step, (action, state) in enumerate(zip(actions.tolist(), states, strict=True), 1)
    )


def actions_in_words(actions: np.ndarray, first: int) -> str:
    """Actions in a list, with the number of their steps."""
    return ", ".join(f"step {step} {vector(action)}" for step, action in enumerate(actions.tolist(), first))


def stated_parameters(level: Levels) -> Iterator[type[Parameter]]:
    """World parameters of a level that are neither switches of a rule space nor constants of its rules."""
    space = level.world.space if level.world is not None else None
    drawn = set() if space is None else set(space.parameters)
    return (p for p in level.layout.parameters if p not in drawn)


def first_sentence(function: Any) -> str:
    """The first sentence of a docstring, without marks of reStructuredText; empty where there is none."""
    paragraph = (inspect.getdoc(function) or "").split("\n\n")[0]
    plain = re.sub(r":\w+:`~?([^`]*)`|`+([^`]*)`+", lambda m: m[1] or m[2], " ".join(paragraph.split()))
    return re.split(r"(?<=[.!?])\s", plain)[0]


def number(value: Any) -> str:
    """A number with six digits at most, as :func:`segar.levels.rules_in_words` has them; never ``-0``."""
    return f"{float(value) + 0.0:.6g}"


def vector(values: Iterable[Any]) -> str:
    """Numbers in brackets."""
    return f"({', '.join(map(number, values))})"


def with_unit(value: Any, factor: type[Factor]) -> str:
    """The value of a factor, one or two numbers, with its unit."""
    values = np.atleast_1d(value)
    text = number(values[0]) if len(values) == 1 else vector(values)
    return f"{text} {factor.unit}".rstrip()


def parameter_value(level: Levels, parameter: type[Parameter]) -> float:
    """The value of a world parameter in a single level."""
    return float(level.parameters[0, level.layout.parameters.index(parameter)])


def rounded(value: Any) -> float:
    """A number with three digits, which words can state in full."""
    return float(f"{float(value):.3g}") + 0.0


def _with_details(option: RuleOption, text: str) -> str:
    """The words of an option, and what its built-in rules compute."""
    details = " ".join(RULES[rule] for rule in option.rules if RULES.get(rule))
    return f"{text}. {details}" if details else text


def _said(rule: Rule) -> str:
    return first_sentence(rule.function) or f"{rule.name.replace('_', ' ')}."


def _entities_in_words(state: Mapping[str, Any], units: Mapping[str, str]) -> Iterator[str]:
    for entity, factors in state.items():
        yield f"{entity} " + ", ".join(
            f"{name} {vector(value) if isinstance(value, list) else number(value)} {units[name]}".rstrip()
            for name, value in factors.items()
        )


def _outline(level: Levels, slot: int) -> str:
    """The outline of a thing, in words."""
    kind = level.shape_kind[0, slot]
    if kind == CIRCLE:
        return ", a disc"
    if kind != HULL:
        return ""
    corners = level.vertices[0, slot, : level.vertex_count[0, slot]]
    return f", a polygon with corners at {', '.join(map(vector, corners))} m from its Position"
