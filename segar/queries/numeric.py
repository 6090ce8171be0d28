"""Questions about a number: where an entity will be (predict), and where it would be (counterfactual)."""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from segar.errors import SegarError
from segar.language import Count, Factor, Position, Scalar, Size, Task, Velocity
from segar.levels import Levels
from segar.queries.changes import Change, FactorChange, change_data, change_of
from segar.queries.draws import draw_changes
from segar.queries.kind import Draft, Mark
from segar.queries.numbers import number, rounded
from segar.queries.question import (
    Place,
    Question,
    changing_places,
    draw_actions,
    place_of,
    plain,
    read_actions,
    told,
    value_at,
)
from segar.queries.trajectories import Player
from segar.queries.words import actions_in_words
from segar.support import misfit

SCALES: dict[type[Factor], float] = {Position: 0.1, Velocity: 0.2}  # [m], [m/s]; of other factors a share of the value
SHARE = 0.1  # of the value that a number has, as the scale of its errors
TOLERANCE = 0.5  # of the scale: an answer nearer than that is right
LEAST_CHANGE = 3.0  # of the scale: what is asked differs so much from what was seen
HISTORY = (6, 10)  # steps that are seen, at least and at most
AHEAD = (6, 12)  # steps that are not
TRIED_CHANGES = 8
ASKED = {"entity": str, "factor": str, "step": int, "tolerance": float, "scale": float}


@dataclass(frozen=True)
class Predict:
    """Where an entity is, or another number of it, some steps after those that were seen, under given actions."""

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

    def check(self, question: Question) -> None:
        _check(question, {"actions": [[float]]})
        steps = len(_ahead(question)) + len(question.actions)
        if question.ask["step"] != steps:
            raise SegarError(f"'ask.step' must be {steps}, after the last action, not {question.ask['step']}")

    def misfit(self, question: Question, answer: Any) -> str | None:
        return _misfit(question, answer)

    def truth(self, question: Question, player: Player) -> np.ndarray:
        """What the simulator says, float64 ``(1,)`` or ``(2,)``."""
        actions = np.concatenate([question.actions, _ahead(question)])
        return value_at(question.level, player.play(question.level, actions).states[0, -1], _place(question))

    def mark(self, question: Question, answer: Any, player: Player) -> Mark:
        return _mark(question, answer, self.truth(question, player))


@dataclass(frozen=True)
class Counterfactual:
    """Where an entity would be after a step that was seen, if one thing had been different from the beginning."""

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

    def check(self, question: Question) -> None:
        _check(question, {"change": dict})
        if not 1 <= question.ask["step"] <= len(question.actions):
            raise SegarError(f"'ask.step' must be 1 to {len(question.actions)}, not {question.ask['step']}")
        _changed(question)

    def misfit(self, question: Question, answer: Any) -> str | None:
        return _misfit(question, answer)

    def truth(self, question: Question, player: Player) -> np.ndarray:
        """What the simulator says, float64 ``(1,)`` or ``(2,)``."""
        level, actions = _changed(question)
        states = player.play(level, actions[: question.ask["step"]]).states
        return value_at(level, states[0, -1], _place(question))

    def mark(self, question: Question, answer: Any, player: Player) -> Mark:
        return _mark(question, answer, self.truth(question, player))


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


def _check(question: Question, more: dict[str, Any]) -> None:
    """Raise :class:`SegarError` unless a number of an entity of the level is asked for."""
    wrong = misfit(question.ask, ASKED | more, "ask", only=True)
    if wrong is None:
        wrong = next((f"'ask.{n}' must be above 0" for n in ("tolerance", "scale") if question.ask[n] <= 0), None)
    if wrong is None and np.isnan(value_at(question.level, question.level.values[0], _place(question))).any():
        wrong = f"'ask.factor': '{question.ask['entity']}' has no {question.ask['factor']}"
    if wrong:
        raise SegarError(wrong)


def _misfit(question: Question, answer: Any) -> str | None:
    width = _place(question)[1].width
    wrong = misfit(answer, float if width == 1 else [float], "answer")
    return wrong or (
        f"'answer' must be a list of two numbers, not of {len(answer)}" if width == 2 and len(answer) != 2 else None
    )


def _mark(question: Question, answer: Any, truth: np.ndarray) -> Mark:
    error = math.dist(answer if isinstance(answer, list) else [answer], truth)
    return Mark(error <= question.ask["tolerance"], math.exp(-error / question.ask["scale"]))


def _place(question: Question) -> Place:
    return place_of(question.level, question.ask["entity"], question.ask["factor"])


def _ahead(question: Question) -> np.ndarray:
    return read_actions(question.ask["actions"], question.task, "'ask.actions'")


def _changed(question: Question) -> tuple[Levels, np.ndarray]:
    """The level and the actions of a counterfactual after its change."""
    return change_of(question.ask["change"], "ask.change").applied(question.level, question.actions)
