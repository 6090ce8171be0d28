"""CONTRIBUTING.md answers questions of new readers by places in the code; each place exists."""

import re

import pytest

from tests.places import ROOT
from tests.project.rooms import ROOMS

TEXT = (ROOT / "CONTRIBUTING.md").read_text()
QUESTION = re.compile(r"^\| ([^|]*\?) \| ([^|]*) \|$", re.M)
PLACE = re.compile(r"`([\w./]+?)(?:::(\w+))?`")
QUESTIONS = QUESTION.findall(TEXT)


def test_there_are_questions():
    assert len(QUESTIONS) >= 10


@pytest.mark.parametrize(("question", "answer"), QUESTIONS, ids=[question for question, _ in QUESTIONS])
def test_a_question_is_answered_by_places_that_exist(question, answer):
    places = PLACE.findall(answer)
    assert places
    for path, name in places:
        assert (ROOT / path).exists(), f"there is no {path}"
        assert not name or defines((ROOT / path).read_text(), name), f"{path} does not define {name}"


def defines(source: str, name: str) -> bool:
    """Whether a file defines a function, a method, a class or a variable of this name, also in a template of source."""
    return bool(re.search(rf"^\s*(?:def|class) {name}\b|^{name}\b.*?=", source, re.M))


@pytest.mark.parametrize("room", ROOMS)
def test_a_room_exists_and_says_what_is_in_it(room):
    face = ROOT / room if room.endswith(".py") else ROOT / room / "__init__.py"
    assert face.read_text().lstrip().startswith('"""')
