"""Grades answers: what is true is found by the simulator, from the questions alone."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from segar.errors import SegarError, did_you_mean
from segar.evaluation import Interval
from segar.hardness import wilson_interval
from segar.queries.kinds import KINDS, Mark
from segar.queries.question import Question, places_of, told
from segar.queries.trajectories import Player
from segar.support import shown


@dataclass(frozen=True, eq=False)
class Grades:
    """The marks of answers; what is missing has the worst one.

    Attributes:
        kinds: the kind of each question, by id.
        marks: the mark of each question, by id.
        missing: ids of questions without an answer.
    """

    kinds: Mapping[str, str]
    marks: Mapping[str, Mark]
    missing: tuple[str, ...]

    def of(self, kind: str | None = None) -> list[Mark]:
        """The marks of the questions of a kind; of all where it is None.

        Raises:
            SegarError: there is no question of that kind.
        """
        found = [mark for name, mark in self.marks.items() if kind in (None, self.kinds[name])]
        if not found:
            asked = set(self.kinds.values())
            raise SegarError(
                "no question was graded"
                if kind is None
                else f"no question is of the kind '{kind}'.{did_you_mean(kind, asked)}"
            )
        return found

    def correct(self, kind: str | None = None) -> Interval:
        """The share of right answers, with Wilson's interval of 95 % over questions; of all kinds where it is None."""
        return _share([float(mark.correct) for mark in self.of(kind)])

    def score(self, kind: str | None = None) -> Interval:
        """The mean score, with Wilson's interval over questions, which is too wide rather than too narrow for scores between
        0 and 1."""
        return _share([mark.score for mark in self.of(kind)])


def grade(questions: Sequence[Question], answers: Mapping[str, Any]) -> Grades:
    """The marks of answers.

    Args:
        answers: by the ids of the questions, as :func:`segar.queries.read_answers` gives them; None is no answer.

    Raises:
        SegarError: an answer does not have the form that its question asks for, or the simulator does not lead to the history
            that a question tells.
    """
    players: dict[str, Player] = {}
    marks: dict[str, Mark] = {}
    for question in questions:
        player = players.setdefault(question.task_name, Player(question.task))
        is_missing = answers.get(question.id) is None
        marks[question.id] = Mark(False, 0.0) if is_missing else _marked(question, answers[question.id], player)
    missing = tuple(question.id for question in questions if answers.get(question.id) is None)
    return Grades({question.id: question.kind for question in questions}, marks, missing)


def _share(values: Sequence[float]) -> Interval:
    """The mean of values between 0 and 1, with Wilson's interval of 95 % for a share."""
    mean = sum(values) / len(values)
    low, high = wilson_interval(mean, len(values))
    return Interval(mean, float(low), float(high))


def _marked(question: Question, answer: Any, player: Player) -> Mark:
    if wrong := KINDS[question.kind].misfit(question, answer):
        raise SegarError(f"question {shown(question.id)}: {wrong}")
    _check_history(question, player)
    return KINDS[question.kind].mark(question, answer, player)


def _check_history(question: Question, player: Player) -> None:
    """Raise :class:`SegarError` unless the actions of a question lead to its history, to the bit."""
    states = player.play(question.level, question.actions).states[0]
    if told(question.level, states, places_of(question.level, question.states)) != list(question.states):
        raise SegarError(
            f"question {shown(question.id)}: its actions lead to another history than it tells. Its rules or its task are not"
            " those with which it was written (--world, --task), or it was changed"
        )
