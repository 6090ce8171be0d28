"""What every kind of question can do: draw a question about a level, know its answer, and grade the answers of others."""

from dataclasses import dataclass
from typing import Any, NamedTuple, Protocol

import numpy as np

from segar.language import Task
from segar.levels import Levels
from segar.queries.question import Question
from segar.queries.trajectories import Player


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
