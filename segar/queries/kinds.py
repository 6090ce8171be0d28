"""The kinds of questions: draw one about a level, know its answer, and grade the answers of others."""

import math
import string
from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, ClassVar, NamedTuple, Protocol

import numpy as np

from segar.errors import SegarError
from segar.hardness import plan
from segar.language import Count, Factor, Position, Scalar, Size, Task, Velocity
from segar.levels import Levels
from segar.queries.changes import Case, Change, FactorChange, change_data, change_of, draw_changes
from segar.queries.question import (
    MOTION,
    STATES,
    Place,
    Question,
    changing_places,
    draw_actions,
    place_of,
    places_of,
    plain,
    read_actions,
    told,
    units_of,
    value_at,
)
from segar.queries.trajectories import Player
from segar.queries.words import actions_in_words, history_in_words, number, rounded
from segar.support import misfit, shown

HISTORY = (6, 10)  # steps that are seen, at least and at most


@dataclass(frozen=True, eq=False)
class Draft:
    """A question before it has a name.

    Attributes:
        actions: float64 ``(steps, action size)``, what was done first.
        states: what was seen after each of these steps.
        ask: what is asked, as plain data.
        asked: the same in words, with the form of the answer.
        answer: as plain data.
    """

    actions: np.ndarray
    states: list[dict[str, Any]]
    ask: dict[str, Any]
    asked: str
    answer: Any


class Mark(NamedTuple):
    """How good an answer is.

    Attributes:
        correct: whether it is right.
        score: from 0 to 1; 1 is a perfect answer.
    """

    correct: bool
    score: float


class Kind(Protocol):
    """A kind of question."""

    def draw(self, level: Levels, task: Task, player: Player, rng: np.random.Generator) -> Draft | None:
        """A question about a single level; None where what was drawn makes no good question."""
        ...

    def check(self, question: Question) -> None:
        """Raise :class:`SegarError` where what is asked does not have the form, or does not fit the level."""
        ...

    def misfit(self, question: Question, answer: Any) -> str | None:
        """What is wrong with the form of an answer, in words; None where it has the form."""
        ...

    def mark(self, question: Question, answer: Any, player: Player) -> Mark:
        """The mark of an answer that has the form; what is true is found by the simulator."""
        ...


# Questions for a number: where an entity will be, and where it would be.

SCALES: dict[type[Factor], float] = {Position: 0.1, Velocity: 0.2}  # [m], [m/s]; of other factors a share of the value
SHARE = 0.1  # of the value that a number has, as the scale of its errors
TOLERANCE = 0.5  # of the scale: an answer nearer than that is right
LEAST_CHANGE = 3.0  # of the scale: what is asked differs so much from what was seen
AHEAD = (6, 12)  # steps that are not
TRIED_CHANGES = 8
ASKED = {"entity": str, "factor": str, "step": int, "tolerance": float, "scale": float}


class _Number(ABC):
    """A question for a factor of an entity after a step; kinds differ in the case in which that is."""

    more: ClassVar[dict[str, Any]]
    """The form of what is asked beyond :data:`ASKED`."""

    @abstractmethod
    def case(self, question: Question) -> Case:
        """The level, and the actions up to the step; raises :class:`SegarError` where what is asked does not fit."""

    def check(self, question: Question) -> None:
        wrong = misfit(question.ask, ASKED | self.more, "ask", only=True)
        if wrong is None:
            wrong = next((f"'ask.{n}' must be above 0" for n in ("tolerance", "scale") if question.ask[n] <= 0), None)
        if wrong is None and np.isnan(value_at(question.level, question.level.values[0], _place(question))).any():
            wrong = f"'ask.factor': '{question.ask['entity']}' has no {question.ask['factor']}"
        if wrong:
            raise SegarError(wrong)
        self.case(question)

    def misfit(self, question: Question, answer: Any) -> str | None:
        width = _place(question)[1].width
        wrong = misfit(answer, float if width == 1 else [float], "answer")
        return wrong or (
            f"'answer' must be a list of two numbers, not of {len(answer)}" if width == 2 and len(answer) != 2 else None
        )

    def truth(self, question: Question, player: Player) -> np.ndarray:
        """What the simulator says, float64 ``(1,)`` or ``(2,)``."""
        return value_at(question.level, player.play(*self.case(question)).states[0, -1], _place(question))

    def mark(self, question: Question, answer: Any, player: Player) -> Mark:
        error = math.dist(answer if isinstance(answer, list) else [answer], self.truth(question, player))
        return Mark(error <= question.ask["tolerance"], math.exp(-error / question.ask["scale"]))


class Predict(_Number):
    """Where an entity is, or another number of it, some steps after those that were seen, under given actions."""

    more: ClassVar = {"actions": [[float]]}

    def draw(self, level: Levels, task: Task, player: Player, rng: np.random.Generator) -> Draft | None:
        seen, ahead = (int(rng.integers(low, high + 1)) for low, high in (HISTORY, AHEAD))
        actions = draw_actions(task, seen + ahead, rng)
        found = player.play(level, actions)
        if not found.go_on[0]:
            return None
        states = found.states[0]
        place = draw_place(level, states[seen], states[-1], rng)
        told_states = _told(level, states[: seen + 1])
        if place is None or not any(told_states):
            return None
        step = seen + ahead
        ask = _asked(level, place, step, states[seen]) | {"actions": actions[seen:].tolist()}
        asked = f"The next actions are: {actions_in_words(actions[seen:], seen + 1)}.\n\n" + _in_words(
            level, place, ask
        )
        return Draft(actions[:seen], told_states, ask, asked, plain(value_at(level, states[-1], place)))

    def case(self, question: Question) -> Case:
        ahead = read_actions(question.ask["actions"], question.task, "'ask.actions'")
        actions = np.concatenate([question.actions, ahead])
        if question.ask["step"] != len(actions):
            raise SegarError(f"'ask.step' must be {len(actions)}, after the last action, not {question.ask['step']}")
        return question.level, actions


class Counterfactual(_Number):
    """Where an entity would be after a step that was seen, if one thing had been different from the beginning."""

    more: ClassVar = {"change": dict}

    def draw(self, level: Levels, task: Task, player: Player, rng: np.random.Generator) -> Draft | None:
        seen = int(rng.integers(HISTORY[1], AHEAD[1] + 1))
        actions = draw_actions(task, seen, rng)
        fact = player.play(level, actions)
        if not fact.go_on[0]:
            return None
        changes = draw_changes(level, task, actions, rng, TRIED_CHANGES, with_actions=True)
        for change in changes:
            other = player.play(*change.applied(level, actions))
            if not other.go_on[0]:
                continue
            place = draw_place(level, fact.states[0, -1], other.states[0, -1], rng, change)
            if place is not None:
                ask = _asked(level, place, seen, fact.states[0, -1]) | {"change": change_data(change)}
                words = f"Suppose that one thing is different from the beginning: {change.words(level, actions)}."
                asked = f"{words} All else, and all other actions, are the same.\n\n{_in_words(level, place, ask)}"
                answer = plain(value_at(level, other.states[0, -1], place))
                return Draft(actions, _told(level, fact.states[0]), ask, asked, answer)
        return None

    def case(self, question: Question) -> Case:
        if not 1 <= question.ask["step"] <= len(question.actions):
            raise SegarError(f"'ask.step' must be 1 to {len(question.actions)}, not {question.ask['step']}")
        level, actions = change_of(question.ask["change"], "ask.change").applied(question.level, question.actions)
        return level, actions[: question.ask["step"]]


def draw_place(
    level: Levels, before: np.ndarray, after: np.ndarray, rng: np.random.Generator, change: Change | None = None
) -> Place | None:
    """A number of an entity that differs between two states; the factor is drawn first. None where there is none.

    Args:
        change: the factor of the entity that it sets is not asked for.
    """
    layout, found = level.layout, dict[type[Factor], list[int]]()
    set_by = (change.entity, change.factor) if isinstance(change, FactorChange) else None
    for slot in np.flatnonzero(level.types[0, :-1] >= 0).tolist():
        for factor in layout.columns:
            is_asked = issubclass(factor, (Position, Velocity, Scalar)) and not issubclass(factor, (Size, Count))
            if not is_asked or (layout.names[slot], factor.__name__) == set_by:
                continue
            old, new = (value_at(level, state, (slot, factor)) for state in (before, after))
            scale = scale_of(factor, old)
            if scale > 0 and np.linalg.norm(new - old) >= LEAST_CHANGE * scale:
                found.setdefault(factor, []).append(slot)
    if not found:
        return None
    factor = list(found)[rng.integers(len(found))]
    return found[factor][rng.integers(len(found[factor]))], factor


def scale_of(factor: type[Factor], value: np.ndarray) -> float:
    """The scale of errors of a factor that had this value, in its unit; nan where the entity has no such factor."""
    own = next((scale for kind, scale in SCALES.items() if issubclass(factor, kind)), SHARE * abs(value[0]))
    return float("nan") if np.isnan(value).any() else rounded(own)


def _told(level: Levels, states: np.ndarray) -> list[dict[str, Any]]:
    return told(level, states, changing_places(level, states[None]))


def _asked(level: Levels, place: Place, step: int, last: np.ndarray) -> dict[str, Any]:
    slot, factor = place
    scale = scale_of(factor, value_at(level, last, place))
    return {
        "entity": level.layout.names[slot],
        "factor": factor.__name__,
        "step": step,
        "tolerance": rounded(TOLERANCE * scale),
        "scale": scale,
    }


def _in_words(level: Levels, place: Place, ask: Mapping[str, Any]) -> str:
    slot, factor = place
    unit = f" {factor.unit}".rstrip()
    form = "a number" if factor.width == 1 else "a list of two numbers, [x, y]"
    return (
        f"Question: what is the {factor.__name__} of {level.layout.names[slot]} after step {ask['step']}?\n"
        f"Answer: {form}{' in' if unit else ''}{unit}. It is right if its error is at most {number(ask['tolerance'])}{unit}."
        f" Its score is exp(-error / {number(ask['scale'])}{unit})."
    )


def _place(question: Question) -> Place:
    return place_of(question.level, question.ask["entity"], question.ask["factor"])


# Questions for a plan.

SAMPLES, ITERATIONS = 64, 4  # of the planner
SPARE = 2  # times the steps of the planner's way are allowed


class MakePlan:
    """Actions that lead from the beginning of the level to success; whatever does is right."""

    def draw(self, level: Levels, task: Task, player: Player, rng: np.random.Generator) -> Draft | None:
        actions = draw_actions(task, int(rng.integers(HISTORY[0], HISTORY[1] + 1)), rng)
        shown = player.play(level, actions)
        if not shown.go_on[0]:
            return None
        best = plan(level, task, rng=rng, samples=SAMPLES, iterations=ITERATIONS)
        if not best.solved[0]:
            return None
        steps = min(task.max_steps, SPARE * int(best.steps[0]))
        steady = steady_players(task, steps)
        if (player.play(level[[0] * len(steady)], steady).solved <= steps).any():
            return None
        answer = best.actions[0, : best.steps[0]].tolist()
        asked = (
            "This was another episode; the level begins anew.\n\n"
            f"Question: which actions lead to success within {steps} steps?\n"
            f"Answer: a list of at most {steps} actions, [[...], ...]. They are taken from the beginning; after the last one"
            " nothing more happens."
        )
        states = told(level, shown.states[0], changing_places(level, shown.states))
        return Draft(actions, states, {"steps": steps}, asked, answer)

    def check(self, question: Question) -> None:
        wrong = misfit(question.ask, {"steps": int}, "ask", only=True)
        if wrong is None and not 1 <= question.ask["steps"] <= question.task.max_steps:
            wrong = f"'ask.steps' must be 1 to {question.task.max_steps}, not {question.ask['steps']}"
        if wrong:
            raise SegarError(wrong)

    def misfit(self, question: Question, answer: Any) -> str | None:
        if wrong := misfit(answer, [[float]], "answer"):
            return wrong
        try:
            read_actions(answer, question.task, "'answer'")
        except SegarError as error:
            return str(error)
        return None

    def mark(self, question: Question, answer: Any, player: Player) -> Mark:
        actions = read_actions(answer, question.task, "'answer'")[: question.ask["steps"]]
        is_right = bool(player.play(question.level, actions).solved[0] <= len(actions))
        return Mark(is_right, float(is_right))


def steady_players(task: Task, steps: int) -> np.ndarray:
    """Actions that are the same in all steps: each number of the action low, idle or high with the others idle, and all at
    once; float64 ``(players, steps, action size)``."""
    low, high = np.array(task.action_low), np.array(task.action_high)
    idle = np.clip(np.zeros(len(low)), low, high)
    one = np.eye(len(low), dtype=bool)
    players = [idle, low, high, *np.where(one, low, idle), *np.where(one, high, idle)]
    return np.repeat(np.array(players)[:, None], steps, axis=1)


# Questions for a cause.

ALTERNATIVES = 4
TRIED_ALTERNATIVES = 24
STEPS = (12, 16)  # of both histories, at least and at most
DIFFERENCE = 0.05  # [m] at least, between the places of some entity at some step in any two histories


class Explain:
    """Which change, of several, leads from the history that was seen first to the second one."""

    def draw(self, level: Levels, task: Task, player: Player, rng: np.random.Generator) -> Draft | None:
        actions = draw_actions(task, int(rng.integers(STEPS[0], STEPS[1] + 1)), rng)
        fact = player.play(level, actions)
        if not fact.go_on[0]:
            return None
        chosen, states = [], [fact.states[0]]
        for change in draw_changes(level, task, actions, rng, TRIED_ALTERNATIVES):
            if len(chosen) == ALTERNATIVES:
                break
            other = player.play(*change.applied(level, actions))
            if other.go_on[0] and all(difference(level, other.states[0], one) >= DIFFERENCE for one in states):
                chosen.append(change)
                states.append(other.states[0])
        if len(chosen) < ALTERNATIVES:
            return None
        right = int(rng.integers(ALTERNATIVES))
        places = changing_places(level, np.stack([states[0], states[1 + right]]), MOTION)
        first, second = told(level, states[0], places), told(level, states[1 + right], places)
        letters = dict(zip(string.ascii_uppercase, chosen, strict=False))
        ask = {"states": second, "alternatives": {letter: change_data(change) for letter, change in letters.items()}}
        listed = "\n".join(f"{letter}. {change.words(level, actions)}" for letter, change in letters.items())
        asked = (
            "One thing was changed at the beginning, and the same actions were taken. This happened:\n"
            f"{history_in_words(actions, second, units_of(level))}\n\n"
            f"Question: which change was it?\n{listed}\nAnswer: one letter."
        )
        return Draft(actions, first, ask, asked, list(letters)[right])

    def check(self, question: Question) -> None:
        wrong = misfit(question.ask, {"states": STATES, "alternatives": {str: dict}}, "ask", only=True)
        states, alternatives = question.ask.get("states", []), question.ask.get("alternatives", {})
        if wrong is None and (len(states) != len(question.actions) or not states):
            wrong = f"'ask.states' must hold a state for each of the {len(question.actions)} actions, not {len(states)}"
        if wrong is None and len(alternatives) < 2:
            wrong = f"'ask.alternatives' must be two or more, not {len(alternatives)}"
        if wrong:
            raise SegarError(wrong)
        places_of(question.level, states)
        for letter, data in alternatives.items():
            change_of(data, f"ask.alternatives.{letter}").applied(question.level, question.actions)

    def misfit(self, question: Question, answer: Any) -> str | None:
        letters = list(question.ask["alternatives"])
        known = isinstance(answer, str) and answer in letters
        return None if known else f"'answer' must be one of {', '.join(letters)}, not {shown(answer)}"

    def truth(self, question: Question, player: Player) -> str:
        """The alternative with which the simulator gives the second history, to the bit.

        Raises:
            SegarError: there is no such alternative, or there are several.
        """
        places = places_of(question.level, question.ask["states"])
        found = []
        for letter, data in question.ask["alternatives"].items():
            changed, actions = change_of(data, "").applied(question.level, question.actions)
            states = player.play(changed, actions).states[0]
            if told(question.level, states, places) == list(question.ask["states"]):
                found.append(letter)
        if len(found) != 1:
            raise SegarError(
                f"'ask.alternatives': {len(found)} of them lead to 'ask.states', and one must; the question was changed, or"
                " it was written with other rules"
            )
        return found[0]

    def mark(self, question: Question, answer: Any, player: Player) -> Mark:
        is_right = answer == self.truth(question, player)
        return Mark(is_right, float(is_right))


def difference(level: Levels, one: np.ndarray, other: np.ndarray) -> float:
    """The largest distance between the places of an entity in two histories ``(steps + 1, entities, columns)`` [m]."""
    column = level.layout.columns[Position]
    apart = np.linalg.norm(one[:, :, column : column + 2] - other[:, :, column : column + 2], axis=-1)
    return float(np.nanmax(apart, initial=0.0))


KINDS: Mapping[str, Kind] = {
    "predict": Predict(),
    "plan": MakePlan(),
    "explain": Explain(),
    "counterfactual": Counterfactual(),
}
"""The kinds of questions, by name."""
