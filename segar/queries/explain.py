"""Questions about a cause: which of several changes has made a second history out of the first."""

import string
from dataclasses import dataclass
from typing import Any

import numpy as np

from segar.errors import SegarError
from segar.language import Position, Task
from segar.levels import Levels
from segar.queries.changes import change_data, change_of
from segar.queries.draws import draw_changes
from segar.queries.kind import Draft, Mark
from segar.queries.question import (
    MOTION,
    STATES,
    Question,
    changing_places,
    draw_actions,
    places_of,
    told,
    units_of,
)
from segar.queries.trajectories import Player
from segar.queries.words import history_in_words
from segar.support import misfit, shown

ALTERNATIVES = 4
TRIED_CHANGES = 24
STEPS = (12, 16)  # of both histories, at least and at most
DIFFERENCE = 0.05  # [m] at least, between the places of some entity at some step in any two histories


@dataclass(frozen=True)
class Explain:
    """Which change, of several, leads from the history that was seen first to the second one."""

    def draw(self, level: Levels, task: Task, player: Player, rng: np.random.Generator) -> Draft | None:
        actions = draw_actions(task, int(rng.integers(STEPS[0], STEPS[1] + 1)), rng)
        fact = player.play(level, actions)
        if not fact.go_on[0]:
            return None
        chosen, states = [], [fact.states[0]]
        for change in draw_changes(level, task, actions, rng, TRIED_CHANGES):
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
