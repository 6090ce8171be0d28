"""Questions about a hidden world: predict, plan, counterfactual. The simulator makes them and marks answers."""

import math
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, replace
from typing import Any, NamedTuple, TypeAlias

import numpy as np

from segar.errors import SegarError
from segar.hardness import plan
from segar.lab.hidden_world import QUESTION_LEVELS, START_LEVELS, Lab, Played
from segar.language import (
    Count,
    Factor,
    Framerate,
    MaxVelocity,
    MinMass,
    MinVelocity,
    Parameter,
    Position,
    Scalar,
    Size,
    Task,
    Velocity,
)
from segar.levels import Levels, active_options
from segar.support import require_form

HISTORY = (6, 10)  # steps that are seen, at least and at most
AHEAD = (6, 12)  # steps that are not
STRENGTH = 0.3  # of drawn actions, as a share of half the range
ACTING = 0.5  # share of the steps with an action that is not idle
SCALES: dict[type[Factor], float] = {Position: 0.1, Velocity: 0.2}  # [m], [m/s]; of other factors a share of the value
SHARE = 0.1  # of the value that a number has, as the scale of its errors
TOLERANCE = 0.5  # of the scale: an answer nearer than that is right
LEAST_CHANGE = 3.0  # of the scale: what is asked differs so much from what was seen
TRIED_CHANGES = 8
FACTORS = (0.25, 0.5, 2.0, 4.0)  # by which a number is multiplied
FROM_ZERO = (0.5, 1.0)  # what a number becomes that is 0
TECHNICAL = (Framerate, MaxVelocity, MinMass, MinVelocity)  # parameters of the simulation rather than of the physics
SAMPLES, ITERATIONS = 64, 4  # of the planner
SPARE = 2  # times the steps of the planner's way are allowed

Case: TypeAlias = tuple[Levels, np.ndarray, np.ndarray]
"""A law, the first state ``(entities, columns)``, and the actions ``(steps, action size)``."""


class Mark(NamedTuple):
    """How good an answer is: whether it is right, and a score from 0 to 1."""

    correct: bool
    score: float


@dataclass(frozen=True, eq=False)
class Question:
    """A question about a level of the hidden world.

    Attributes:
        ask: what the experimenter gets, as plain data: ``id``, ``kind``, the level, actions and observations, what is asked,
            and the same in words.
        mark: from an answer to its mark; None is no answer, and wrong. Raises :class:`SegarError` for one of another form.
    """

    ask: Mapping[str, Any]
    mark: Callable[[Any], Mark]


def make_questions(lab: Lab) -> list[Question]:
    """So many questions of each kind as the lab says, each about a level of its own in which no experiment begins.

    Levels that make no good question are passed over: where nothing moves, where the task is over too early, where no plan
    is found or where pushing steadily is one.

    Raises:
        SegarError: too few levels make a good question.
    """
    found = []
    for place, (kind, draw) in enumerate(KINDS.items()):
        own: list[Question] = []
        for index in range(START_LEVELS + place, len(lab.levels), len(KINDS)):
            if len(own) == lab.questions:
                break
            question = draw(lab, index, np.random.default_rng((lab.seed, lab.world, index)))
            own += [] if question is None else [question]
        if len(own) < lab.questions:
            raise SegarError(
                f"only {len(own)} of {lab.questions} questions of the kind '{kind}' were found on"
                f" {QUESTION_LEVELS // len(KINDS) * lab.questions} levels; ask for fewer"
            )
        found += own
    return found


def _predict(lab: Lab, index: int, rng: np.random.Generator) -> Question | None:
    """Where an entity is, or another number of it, some steps after those that were seen, under given actions."""
    seen, ahead = (int(rng.integers(low, high + 1)) for low, high in (HISTORY, AHEAD))
    actions = draw_actions(lab.task, seen + ahead, rng)
    played = _play(lab, index, (lab.hidden, lab.levels.values[index], actions))
    states = played.seen[0, 0]
    if played.ends[0, 0] <= seen + ahead:
        return None
    return _for_number(lab, index, actions, states[: seen + 1], states[-1], {}, rng)


def _counterfactual(lab: Lab, index: int, rng: np.random.Generator) -> Question | None:
    """Where an entity would be after the steps that were seen, if one thing had been different from the beginning."""
    actions = draw_actions(lab.task, int(rng.integers(HISTORY[1], AHEAD[1] + 1)), rng)
    fact = (lab.hidden, lab.levels.values[index], actions)
    played = _play(lab, index, fact)
    if played.ends[0, 0] <= len(actions):
        return None
    for change, case in _changes(lab, fact, rng):
        other = _play(lab, index, case)
        if other.ends[0, 0] > len(actions):
            question = _for_number(lab, index, actions, played.seen[0, 0], other.seen[0, 0, -1], change, rng)
            if question is not None:
                return question
    return None


def _for_number(
    lab: Lab, index: int, actions: np.ndarray, seen: np.ndarray, after: np.ndarray, change: Mapping[str, Any],
    rng: np.random.Generator,
) -> Question | None:  # fmt: skip
    """A question for a number of an entity that differs between the last state that was seen and the one ``after``, which came
    later, or would have come with a change; the factor is drawn first."""
    before, kind = seen[-1], "counterfactual" if change else "predict"
    known: dict[str, list[tuple[str, type[Factor], slice, float]]] = {}
    for name, at in lab.places.items():
        entity, factor = name.split(".")[0], lab.hidden.layout.factor(name.split(".")[1])
        part = slice(at, at + factor.width)
        scale = scale_of(factor, before.reshape(-1)[part])
        is_asked = issubclass(factor, (Position, Velocity, Scalar)) and not issubclass(factor, (Size, Count))
        is_asked &= factor.__name__ not in change.get("set", {}).get(entity, {}) and not name.endswith(".y")
        if is_asked and np.linalg.norm((after - before).reshape(-1)[part]) >= LEAST_CHANGE * scale > 0:
            known.setdefault(factor.__name__, []).append((entity, factor, part, scale))
    if not known:
        return None
    same = known[list(known)[rng.integers(len(known))]]
    entity, factor, part, scale = same[rng.integers(len(same))]
    truth, unit, width = after.reshape(-1)[part], f" {factor.unit}".rstrip(), factor.width
    ask: dict[str, Any] = _head(lab, index, kind, actions, seen) | ({"change": dict(change)} if change else {})
    ask |= {"entity": entity, "factor": factor.__name__, "step": len(actions)}
    ask |= {"tolerance": (tolerance := rounded(TOLERANCE * scale)), "scale": scale}
    ask["text"] = (
        f"{'If the change had been made at the beginning, what' if change else 'What'} is the {factor.__name__} of {entity}"
        f" after step {len(actions)}? Answer with {'two numbers, [x, y]' if width == 2 else 'a number'}{unit and ' in'}{unit}."
        f" An error up to {tolerance:g}{unit} is right; the score is exp(-error / {scale:g}{unit})."
    )

    def mark(answer: Any) -> Mark:
        if answer is None:
            return Mark(False, 0.0)
        require_form(answer, float if width == 1 else [float], f"answers.{ask['id']}")
        if width == 2 and len(answer) != 2:
            raise SegarError(f"'answers.{ask['id']}' must be two numbers, not {len(answer)}")
        error = math.dist(np.atleast_1d(answer), truth)
        return Mark(error <= tolerance, math.exp(-error / scale))

    return Question(ask, mark)


def _plan(lab: Lab, index: int, rng: np.random.Generator) -> Question | None:
    """Actions that lead from the beginning of the level to success; whatever does is right."""
    task = lab.task
    level = lab.levels[index].with_parameters(lab.hidden.parameters)
    best = plan(level, task, rng=rng, samples=SAMPLES, iterations=ITERATIONS)
    if not best.solved[0]:
        return None
    steps = min(task.max_steps, SPARE * int(best.steps[0]))

    def solves(actions: np.ndarray) -> bool:
        played = _play(lab, index, (lab.hidden, level.values[0], actions))
        return bool(played.solved[0, 0] <= len(actions))

    if any(map(solves, steady_players(task, steps))):
        return None
    ask = _head(lab, index, "plan", np.zeros((0, len(task.action_low))), level.values) | {"steps": steps}
    ask["text"] = (
        f"Which actions lead to success within {steps} steps? Answer with a list of at most {steps} actions. They are taken"
        " from the beginning; after the last one nothing more happens."
    )

    def mark(answer: Any) -> Mark:
        if answer is None:
            return Mark(False, 0.0)
        require_form(answer, [[float]], at := f"answers.{ask['id']}")
        for step, action in enumerate(answer):
            if len(action) != len(task.action_low):
                raise SegarError(f"'{at}[{step}]' must be {len(task.action_low)} numbers, not {len(action)}")
        is_right = bool(answer) and solves(np.array(answer[:steps]))
        return Mark(is_right, float(is_right))

    return Question(ask, mark)


KINDS = {"predict": _predict, "plan": _plan, "counterfactual": _counterfactual}
"""How questions of each kind are drawn about a level; None where what was drawn makes no good question."""


def draw_actions(task: Task, steps: int, rng: np.random.Generator) -> np.ndarray:
    """Weak actions, half of them idle, with three digits; float64 ``(steps, action size)``."""
    low, high = np.array(task.action_low), np.array(task.action_high)
    drawn = (low + high) / 2 + STRENGTH * (high - low) / 2 * rng.uniform(-1, 1, (steps, len(low)))
    chosen = np.where(rng.random((steps, 1)) < ACTING, drawn, np.clip(np.zeros(len(low)), low, high))
    return np.vectorize(rounded, otypes=[float])(chosen)


def steady_players(task: Task, steps: int) -> np.ndarray:
    """Actions that are the same in all steps: each number of the action low, idle or high with the others idle, and all at
    once; float64 ``(players, steps, action size)``."""
    low, high = np.array(task.action_low), np.array(task.action_high)
    idle, one = np.clip(np.zeros(len(low)), low, high), np.eye(len(low), dtype=bool)
    players = [idle, low, high, *np.where(one, low, idle), *np.where(one, high, idle)]
    return np.repeat(np.array(players)[:, None], steps, axis=1)


def scale_of(factor: type[Factor], value: np.ndarray) -> float:
    """The scale of errors of a factor that had this value, in its unit; nan where the entity has no such factor."""
    own = next((scale for kind, scale in SCALES.items() if issubclass(factor, kind)), SHARE * abs(value[0]))
    return float("nan") if np.isnan(value).any() else rounded(own)


def rounded(value: Any) -> float:
    """A number with three digits."""
    return float(f"{float(value):.3g}") + 0.0


def _changes(lab: Lab, fact: Case, rng: np.random.Generator) -> Iterator[tuple[dict[str, Any], Case]]:
    """Changes of one thing, as data, each with the case in which it was made; first the sort is drawn, then what changes."""
    for _ in range(TRIED_CHANGES):
        found = SORTS[rng.integers(len(SORTS))](lab, fact, rng)
        if found is not None:
            yield found


def _other_value(lab: Lab, fact: Case, rng: np.random.Generator) -> tuple[dict[str, Any], Case]:
    laws, values, actions = fact
    layout, slots = laws.layout, range(len(laws.layout.slots) - 1)
    places = [(s, f) for s in slots for f in lab.settable if not np.isnan(values[s, layout.columns_of(f)]).any()]
    slot, factor = places[rng.integers(len(places))]
    value, other = [rounded(x) for x in rng.uniform(*lab.settable[factor], factor.width)], values.copy()
    other[slot, layout.columns_of(factor)] = value
    named = {factor.__name__: value if factor.width > 1 else value[0]}
    return {"set": {layout.names[slot]: named}}, (laws, other, actions)


def _other_action(lab: Lab, fact: Case, rng: np.random.Generator) -> tuple[dict[str, Any], Case]:
    laws, values, actions = fact
    step, other = int(rng.integers(len(actions))), actions.copy()
    other[step] = draw_actions(lab.task, 1, rng)[0]
    return {"action": {"step": step + 1, "value": other[step].tolist()}}, (laws, values, other)


def _other_parameter(lab: Lab, fact: Case, rng: np.random.Generator) -> tuple[dict[str, Any], Case] | None:
    laws, values, actions = fact
    stated = [p for p in laws.layout.parameters if p not in (*lab.space.parameters, *TECHNICAL)]
    parameter = stated[rng.integers(len(stated))]
    before = laws.parameters[0, laws.layout.parameters.index(parameter)]
    value = rounded(before * rng.choice(FACTORS) if before else rng.choice(FROM_ZERO))
    if not parameter.is_possible(np.array([value])).all():
        return None
    return {"parameter": {parameter.__name__: value}}, (_with(laws, {parameter: value}), values, actions)


def _one_more_option(lab: Lab, fact: Case, rng: np.random.Generator) -> tuple[dict[str, Any], Case] | None:
    laws, values, actions = fact
    active = dict(zip(lab.space.options, active_options(laws)[0], strict=True))
    held = [option.active for option, holds in active.items() if holds]
    option = lab.space.options[rng.integers(len(lab.space.options))]
    if active[option] or not all(lab.space.may_meet(option.active, other) for other in held):
        return None
    constants = {p: rounded(np.ravel(lab.space.laws[p].sample(rng, 1))[0]) for p in option.constants}
    named = {option.name: {p.__name__: value for p, value in constants.items()}}
    return {"option": named}, (_with(laws, {option.active: 1.0, **constants}), values, actions)


SORTS = (_other_value, _other_action, _other_parameter, _one_more_option)


def _with(laws: Levels, new: Mapping[type[Parameter], float]) -> Levels:
    """The law with other values of some world parameters."""
    parameters = laws.parameters.copy()
    for parameter, value in new.items():
        parameters[0, laws.layout.parameters.index(parameter)] = value
    return replace(laws, parameters=parameters)


def _play(lab: Lab, index: int, case: Case) -> Played:
    """The whole states ``(1, 1, steps + 1, entities * columns)`` of a case."""
    laws, values, actions = case
    return lab.play(laws, np.array([index]), values[None], actions[None].astype(np.float32), range(values.size))


def _head(lab: Lab, index: int, kind: str, actions: np.ndarray, states: np.ndarray) -> dict[str, Any]:
    """What every question holds: its level, and what was seen there, with the noise of the lab."""
    seen = lab.observed(states.reshape(len(states), -1)[:, list(lab.places.values())], index + lab.budget)
    head = {"id": f"{kind}-{index}", "kind": kind, "level": index}
    return head | {"actions": actions.tolist(), "observations": seen}
