"""Sets of questions that tests read: about one world for all, and about a rule space."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import pytest

import segar
from segar.queries import Question, make_questions
from segar.rules import templates

NUMBER = 20  # of questions of each kind
WORLDS = ("default rules", "rule space")


@dataclass(frozen=True)
class Made:
    """Questions and their answers."""

    distribution: segar.LevelDistribution
    questions: Sequence[Question]
    answers: Mapping[str, Any]

    def of(self, *kinds: str) -> list[Question]:
        return [question for question in self.questions if question.kind in kinds]


@pytest.fixture(scope="session")
def default_rules() -> Made:
    distribution = segar.family("objectsx1-hard")
    return Made(distribution, *make_questions(distribution, NUMBER, seed=3))


@pytest.fixture(scope="session")
def rule_space() -> Made:
    distribution = segar.family("objectsx1-hard").with_rules(templates.dynamics_space())
    return Made(distribution, *make_questions(distribution, NUMBER, seed=3))


@pytest.fixture(params=[WORLDS[0], pytest.param(WORLDS[1], marks=pytest.mark.slow)])
def made(request) -> Made:
    """Each of the sets."""
    return request.getfixturevalue(request.param.replace(" ", "_"))
