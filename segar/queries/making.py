"""Makes questions: about levels of a distribution, each kind about levels of its own, so that answers are independent."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from segar.errors import SegarError, did_you_mean
from segar.levels import LevelDistribution, Levels, checks
from segar.queries.kinds import KINDS, Draft
from segar.queries.question import Question, text_of
from segar.queries.trajectories import Player
from segar.support import is_whole
from segar.tasks import make_task

MOST_LEVELS = 40  # that are tried for each question that is asked for
LARGEST_SHARE = 0.1  # of the questions for one factor that one answer may be right for
LEAST_STEPS = 24  # of a task, so that all histories fit


def make_questions(
    distribution: LevelDistribution,
    number: int = 25,
    kinds: Sequence[str] = tuple(KINDS),
    *,
    seed: int = 0,
    split: str = "test",
    task: str | None = None,
) -> tuple[list[Question], dict[str, Any]]:
    """Questions about levels of a distribution, and their answers.

    No level has two questions. Level i of the split is for the kind ``i % 4``, whichever kinds are asked for, and what is
    drawn on it depends on (distribution, seed, split, i) alone. Levels that make no good question are passed over: where
    nothing moves, where the task is over too early, where no plan is found or where pushing steadily is one, or where a
    single answer would be right too often.

    Args:
        number: of questions of each kind.
        kinds: names in :data:`KINDS`.
        seed, split: of the levels and of what is drawn.
        task: 'puttputt', 'billiards', 'invisiball' or ``module:attribute``; None: what the distribution names.

    Returns:
        The questions by kind, and the answers by the questions' ids.

    Raises:
        SegarError: an argument is not known, the rules draw random numbers, or too few levels make a good question.
    """
    checks.require_distribution("make_questions", distribution)
    if isinstance(kinds, str):
        raise SegarError(f"kinds must be a list of names such as ['predict'], not {kinds!r}")
    for kind in kinds:
        if kind not in KINDS:
            raise SegarError(f"there are no questions of the kind '{kind}'.{did_you_mean(kind, KINDS)}")
    if not kinds or len(set(kinds)) < len(kinds):
        raise SegarError(f"kinds must be different names, one at least, not {list(kinds)}")
    if not is_whole(number) or number < 1:
        raise SegarError(f"the number of questions must be a whole number above 0, not {number!r}")
    if not is_whole(seed) or seed < 0:
        raise SegarError(f"the seed must be a whole number that is not negative, not {seed!r}")
    name = task or distribution.task or "puttputt"
    player = Player(make_task(name))
    if player.task.max_steps < LEAST_STEPS:
        raise SegarError(f"questions need a task of {LEAST_STEPS} steps at least; {name} has {player.task.max_steps}")
    source = _Source(distribution, seed, split)
    questions: list[Question] = []
    answers: dict[str, Any] = {}
    for kind in (kind for kind in KINDS if kind in kinds):
        for question, answer in _of_kind(kind, int(number), source, name, player):
            questions.append(question)
            answers[question.id] = answer
    return questions, answers


class _Source:
    """The levels of a split, sampled when they are asked for."""

    def __init__(self, distribution: LevelDistribution, seed: int, split: str) -> None:
        self.distribution, self.seed, self.split = distribution, seed, split
        self._levels = distribution.sample(1, seed, split)

    def level(self, index: int) -> Levels:
        """Level ``index``, as levels of one."""
        if index >= len(self._levels):
            self._levels = self.distribution.sample(2 * index, self.seed, self.split)
        return self._levels[index]


def _of_kind(kind: str, number: int, source: _Source, task: str, player: Player) -> list[tuple[Question, Any]]:
    """So many questions of a kind, with their answers."""
    place, found = list(KINDS).index(kind), list[tuple[Question, Any]]()
    for index in range(place, place + len(KINDS) * MOST_LEVELS * number, len(KINDS)):
        level = source.level(index)
        draft = KINDS[kind].draw(level, player.task, player, np.random.default_rng((source.seed, index)))
        if draft is None or _is_common(draft, found):
            continue
        text = text_of(level, task, player.task, draft.actions, draft.states, draft.asked)
        name = f"{kind}-{index}"
        question = Question(name, kind, level, task, player.task, draft.actions, draft.states, draft.ask, text)
        found.append((question, draft.answer))
        if len(found) == number:
            return found
    raise SegarError(
        f"{source.distribution}: only {len(found)} of {number} questions of the kind '{kind}' were found on"
        f" {MOST_LEVELS * number} levels; ask for fewer, leave the kind out, or take levels in which more happens"
    )


def _is_common(draft: Draft, found: Sequence[tuple[Question, Any]]) -> bool:
    """Whether one answer to a question for a number could be right for too many of those that were found."""
    if "factor" not in draft.ask:
        return False
    same = [(question.ask, answer) for question, answer in found if question.ask["factor"] == draft.ask["factor"]]
    near = sum(
        float(np.linalg.norm(np.subtract(answer, draft.answer))) <= ask["tolerance"] + draft.ask["tolerance"]
        for ask, answer in same
    )
    return near > LARGEST_SHARE * len(same)
