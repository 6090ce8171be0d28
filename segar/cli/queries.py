"""``segar queries``: writes questions about worlds and their answers, and grades the answers of others. No model is called."""

import argparse
import dataclasses
from typing import Any

from segar.cli import arguments
from segar.queries import KINDS, Grades, grade, make_questions, read_answers, read_questions, write_questions
from segar.tasks import make_task

HEAD = ("kind", "questions", "answered", "correct", "from", "to", "score", "from", "to")


def add_commands(commands: Any) -> None:
    """Add ``queries`` to the sub-commands of a parser."""
    queries = commands.add_parser("queries", help="write questions about worlds, and grade answers")
    actions = queries.add_subparsers(required=True, metavar="command")

    purpose = "write questions about levels, and their answers beside them: predict, plan, explain, counterfactual"
    writing = arguments.command(actions, "write", write, purpose)
    writing.add_argument("name", metavar="family", help=arguments.NAME_HELP)
    writing.add_argument(
        "-n",
        "--number",
        type=arguments.at_least(1),
        default=25,
        help="of questions of each kind (default: %(default)s)",
    )
    arguments.add_number(writing, "--seed", "of levels and questions", least=0, default=0)
    writing.add_argument("--split", default="test", help="of the levels, such as train or test (default: %(default)s)")
    writing.add_argument("--kinds", nargs="+", choices=list(KINDS), default=list(KINDS), help="(default: all)")
    writing.add_argument("--task", help=arguments.TASK_HELP)
    writing.add_argument("--world", help=f"{arguments.WORLD_HELP}. They replace those of the distribution")
    arguments.add_output(
        writing, "the questions, a line of JSON for each; FILE.jsonl has its answers in FILE.key.jsonl", required=True
    )

    grading = arguments.command(actions, "grade", grade_answers, "say how good answers to questions are")
    grading.add_argument("questions", metavar="QUESTIONS", help="a file that `segar queries write` wrote")
    grading.add_argument(
        "answers", metavar="ANSWERS", help='the answers, in lines such as {"id": "predict-0", "answer": [0.5, -0.25]}'
    )
    grading.add_argument("--task", help="that is not built in: 'module:attribute'")
    grading.add_argument("--world", help=arguments.WORLD_HELP)


def write(chosen: argparse.Namespace) -> None:
    """``segar queries write``."""
    distribution = arguments.find_distribution(chosen.name)
    if chosen.world is not None:
        distribution = dataclasses.replace(distribution, world=arguments.find_world(chosen.world))
    questions, answers = make_questions(
        distribution, chosen.number, chosen.kinds, seed=chosen.seed, split=chosen.split, task=chosen.task
    )
    key = write_questions(chosen.output, questions, answers)
    numbers = {kind: sum(question.kind == kind for question in questions) for kind in chosen.kinds}
    answer = {"file": chosen.output, "answers": str(key), "questions": numbers, "distribution": distribution.hash}
    answer |= {"seed": chosen.seed, "split": chosen.split}
    listed = ", ".join(f"{number} {kind}" for kind, number in numbers.items())
    arguments.print_answer(chosen, answer, f"{chosen.output}: {listed}\n{key}: the answers")


def grade_answers(chosen: argparse.Namespace) -> None:
    """``segar queries grade``."""
    world = None if chosen.world is None else arguments.find_world(chosen.world)
    task = None if chosen.task is None else make_task(chosen.task)
    questions = read_questions(chosen.questions, world=world, task=task)
    found = grade(questions, read_answers(chosen.answers, questions))
    kinds = list(dict.fromkeys(question.kind for question in questions))
    rows = {kind or "all": _row(found, kind) for kind in (*kinds, None)}
    answer: dict[str, Any] = {"questions": chosen.questions, "answers": chosen.answers, "kinds": rows}
    answer["missing"] = list(found.missing)
    answer["marks"] = {name: mark._asdict() for name, mark in found.marks.items()}
    lines = [
        (kind, row["questions"], row["answered"], row["correct"], *row["correct_95"], row["score"], *row["score_95"])
        for kind, row in rows.items()
    ]
    text = arguments.table(HEAD, lines)
    if found.missing:
        text += f"\n\n{len(found.missing)} questions have no answer and count as wrong: {', '.join(found.missing)}"
    arguments.print_answer(chosen, answer, text)


def _row(found: Grades, kind: str | None) -> dict[str, Any]:
    """The grades of a kind, of all kinds where it is None."""
    names = [name for name in found.marks if kind in (None, found.kinds[name])]
    correct, score = found.correct(kind), found.score(kind)
    return {
        "questions": len(names),
        "answered": sum(name not in found.missing for name in names),
        "correct": correct.value,
        "correct_95": [correct.low, correct.high],
        "score": score.value,
        "score_95": [score.low, score.high],
    }
