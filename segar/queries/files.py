"""Files of questions and of answers: a line of JSON for each."""

import json
from collections.abc import Iterator, Mapping, Sequence
from os import PathLike
from pathlib import Path
from typing import Any

from segar.errors import SegarError, did_you_mean
from segar.language import Task
from segar.queries.kinds import KINDS
from segar.queries.question import Question, question_of
from segar.rules import World
from segar.support import content_of, from_json, misfit, replacing, shown

ANSWER = {"id": str, "answer": object}


def write_questions(path: str | PathLike[str], questions: Sequence[Question], answers: Mapping[str, Any]) -> Path:
    """Write questions to ``path``, and their answers to another file beside it; return its path.

    ``questions.jsonl`` has its answers in ``questions.key.jsonl``, which is a file of answers as everybody gives them.
    Existing files are replaced only by complete ones.

    Raises:
        SegarError: a question has no answer, or a file cannot be written.
    """
    path = Path(path)
    key = path.with_name(f"{path.stem}.key{path.suffix}")
    lines = [_line(question.data()) for question in questions]
    if without := [question.id for question in questions if question.id not in answers]:
        raise SegarError(f"the questions {', '.join(without)} have no answers, and the key must have all")
    answered = [_line({"id": question.id, "answer": answers[question.id]}) for question in questions]
    with replacing(path, "the questions") as beside, replacing(key, "the answers") as beside_key:
        beside.write_text("".join(lines), encoding="ascii")
        beside_key.write_text("".join(answered), encoding="ascii")
    return key


def read_questions(
    path: str | PathLike[str], *, world: World | None = None, task: Task | None = None
) -> list[Question]:
    """The questions in a file that :func:`write_questions` wrote. Nothing that the file names is imported.

    Args:
        world: the rules of levels with rules of their own, which the file does not hold.
        task: what is played, where it is not built in.

    Raises:
        SegarError: there is no such file, or a line is no question; the message names line and field.
    """
    path, found = Path(path), dict[str, Question]()
    for line, data in _lines_of(path, "file of questions"):
        question = question_of(data, path, line, world, task)
        if question.kind not in KINDS:
            raise SegarError(
                f"{path}: line {line}: 'kind' is {shown(question.kind)}.{did_you_mean(question.kind, KINDS)}"
            )
        try:
            KINDS[question.kind].check(question)
        except SegarError as error:
            raise SegarError(f"{path}: line {line}: {error}") from error
        if question.id in found:
            raise SegarError(f"{path}: line {line}: 'id' {shown(question.id)} stands in an earlier line, too")
        found[question.id] = question
    return list(found.values())


def read_answers(path: str | PathLike[str], questions: Sequence[Question]) -> dict[str, Any]:
    """The answers in a file, by the ids of the questions; those that are null are left out.

    Each line is ``{"id": "predict-0", "answer": [0.5, -0.25]}``. Not all questions need an answer.

    Raises:
        SegarError: there is no such file, a line is no answer, or an answer does not have the form that its question asks
            for; the message names line and field.
    """
    path, known = Path(path), {question.id: question for question in questions}
    found: dict[str, Any] = {}
    for line, data in _lines_of(path, "file of answers"):
        at = f"{path}: line {line}: "
        if wrong := misfit(data, ANSWER, only=True):
            raise SegarError(f"{at}{wrong}")
        if data["id"] not in known:
            raise SegarError(f"{at}'id' {shown(data['id'])} is none of the questions")
        if data["id"] in found:
            raise SegarError(f"{at}'id' {shown(data['id'])} stands in an earlier line, too")
        question = known[data["id"]]
        wrong = None if data["answer"] is None else KINDS[question.kind].misfit(question, data["answer"])
        if wrong:
            raise SegarError(f"{at}{wrong}")
        found[data["id"]] = data["answer"]
    return {name: answer for name, answer in found.items() if answer is not None}


def _line(data: Mapping[str, Any]) -> str:
    return json.dumps(data, allow_nan=False) + "\n"


def _lines_of(path: Path, kind: str) -> Iterator[tuple[int, Any]]:
    """The numbers of the lines of a file that are not empty, and the data in them."""
    lines = content_of(path, kind, SegarError).splitlines()
    if not any(line.strip() for line in lines):
        raise SegarError(f"{path} is no {kind}: it is empty")
    for number, line in enumerate(lines, 1):
        if not line.strip():
            continue
        try:
            data = from_json(line)
        except ValueError as error:
            raise SegarError(f"{path}: line {number}: it is no JSON: {error}") from error
        yield number, data
