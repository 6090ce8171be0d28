"""Files of questions and answers: written whole, read as data, refused by line and field."""

import json
import sys

import numpy as np
import pytest

import segar
from segar import cli
from segar.errors import SegarError
from segar.queries import KINDS, grade, read_answers, read_questions, write_questions
from segar.queries.making import make_questions
from tests.crafted import assert_clean_errors, crafted_descriptions, crafted_texts


@pytest.fixture
def files(tmp_path, made):
    """The questions of a set in a file, and their key."""
    chosen = [question for kind in KINDS for question in made.of(kind)[:3]]
    path = tmp_path / "questions.jsonl"
    key = write_questions(path, chosen, made.answers)
    return made, path, key


def lines_of(path):
    return [json.loads(line) for line in path.read_text().splitlines()]


def write_lines(path, lines):
    path.write_text("".join(json.dumps(line) + "\n" for line in lines))


def test_questions_are_read_as_they_were_written_and_the_key_gets_all_marks(files):
    made, path, key = files
    assert key.name == "questions.key.jsonl"
    questions = read_questions(path, world=made.distribution.world)
    for question, line in zip(questions, lines_of(path), strict=True):
        assert question.data() == line
        assert question.level == next(q for q in made.questions if q.id == question.id).level
    found = grade(questions, read_answers(key, questions))
    assert found.correct().value == found.score().value == 1.0
    assert "answer" not in {name for line in lines_of(path) for name in (*line, *line["ask"])}


def test_the_answers_are_not_in_the_questions(files):
    _, path, key = files
    for line, said in zip(lines_of(path), lines_of(key), strict=True):
        if line["kind"] in ("predict", "counterfactual"):
            numbers = np.atleast_1d(said["answer"])
            assert not any(str(number) in json.dumps(line) for number in numbers.tolist() if number)


def test_levels_with_rules_of_their_own_need_these_and_refuse_others(files):
    made, path, key = files
    if made.distribution.world is None:
        questions = read_questions(path, world=segar.World(rules=[segar.move]))
        with pytest.raises(SegarError, match=r"question 'predict-.*': its actions lead to another history"):
            grade(questions, read_answers(key, questions))
        return
    with pytest.raises(SegarError, match=r"questions.jsonl: line 1: 'level' has rules of its own.*--world"):
        read_questions(path)


def test_a_task_of_ones_own_is_given(tmp_path, default_rules):
    write_questions(tmp_path / "q.jsonl", default_rules.of("plan")[:1], default_rules.answers)
    [line] = lines_of(tmp_path / "q.jsonl")
    write_lines(tmp_path / "q.jsonl", [line | {"task": "my_lab.tasks:golf"}])
    with pytest.raises(SegarError, match=r"q.jsonl: line 1: the task 'my_lab.tasks:golf' is not built in"):
        read_questions(tmp_path / "q.jsonl")
    questions = read_questions(tmp_path / "q.jsonl", task=segar.puttputt())
    assert grade(questions, default_rules.answers).correct().value == 1.0
    assert "my_lab" not in sys.modules


WRONG_ANSWERS = {
    "predict": [("x", "'answer' must be a list of float"), ([1.0], "a list of two numbers, not of 1"), (2.0, "must be a list"),
                ([1.0, None], r"'answer\[1\]' must be float, not None"), ([float("nan"), 0.0], r"answer\[0\]")],
    "plan": [([[1.0]], r"'answer'\[0\]: an action of this task has 2 numbers, not 1"), ([1.0, 2.0], r"answer\[0\]"),
             ("up", "must be a list")],
    "explain": [("E", "'answer' must be one of A, B, C, D, not 'E'"), (0, "one of A, B, C, D, not 0"), (["A"], "a list of 1")],
}  # fmt: skip


@pytest.mark.parametrize("kind", WRONG_ANSWERS)
def test_an_answer_of_another_form_is_refused_by_its_line_and_field(kind, tmp_path, default_rules):
    questions = [q for q in default_rules.of(kind) if q.ask.get("factor") in (None, "Position", "Velocity")][:2]
    path = tmp_path / "answers.jsonl"
    for answer, said in WRONG_ANSWERS[kind]:
        good = {"id": questions[0].id, "answer": default_rules.answers[questions[0].id]}
        write_lines(path, [good, {"id": questions[1].id, "answer": answer}])
        with pytest.raises(SegarError, match=rf"answers.jsonl: line 2: .*{said}"):
            read_answers(path, questions)


@pytest.mark.parametrize(
    ("line", "said"),
    [
        ('{"id": "predict-0"', "it is no JSON"),
        ("[]", "'all' must be a mapping"),
        ('{"answer": 3}', "'id' is absent"),
        ('{"id": 3, "answer": 3}', "'id' must be str"),
        ('{"id": "plan-3"}', "'answer' is absent"),
        ('{"id": "plan-3", "answer": 3, "why": 4}', "'why' is not known"),
        ('{"id": "guess-3", "answer": 3}', "'guess-3' is none of the questions"),
    ],
)
def test_a_line_that_is_no_answer_is_refused_by_its_number(line, said, tmp_path, default_rules):
    (tmp_path / "a.jsonl").write_text(f"\n{line}\n")
    with pytest.raises(SegarError, match=rf"a.jsonl: line 2: .*{said}"):
        read_answers(tmp_path / "a.jsonl", default_rules.questions)


def test_answers_may_be_null_and_not_given_twice(tmp_path, default_rules):
    name = default_rules.questions[0].id
    write_lines(tmp_path / "a.jsonl", [{"id": name, "answer": None}])
    assert read_answers(tmp_path / "a.jsonl", default_rules.questions) == {}
    write_lines(tmp_path / "a.jsonl", [{"id": name, "answer": None}] * 2)
    with pytest.raises(SegarError, match=f"line 2: 'id' '{name}' stands in an earlier line"):
        read_answers(tmp_path / "a.jsonl", default_rules.questions)


@pytest.mark.parametrize("name", ["questions", "answers"])
def test_files_that_are_not_there_or_empty_are_said(name, tmp_path, default_rules):
    read = read_questions if name == "questions" else lambda path: read_answers(path, default_rules.questions)
    with pytest.raises(SegarError, match=f"there is no file of {name} .*nothing.jsonl"):
        read(tmp_path / "nothing.jsonl")
    (tmp_path / "empty.jsonl").write_text("\n")
    with pytest.raises(SegarError, match=f"empty.jsonl is no file of {name}: it is empty"):
        read(tmp_path / "empty.jsonl")


@pytest.mark.parametrize("kind", KINDS)
def test_a_question_that_was_changed_is_refused_or_harmless(kind, tmp_path, default_rules):
    """Reading and grading raise errors of SEGAR and no others; nothing that a file names is imported."""
    path, before = tmp_path / "questions.jsonl", set(sys.modules)
    write_questions(path, default_rules.of(kind)[:1], default_rules.answers)
    [data] = lines_of(path)
    level, text = data.pop("level"), data.pop("text")
    data["units"], data["rules"] = {"Mass": "kg"}, data["rules"][:1]

    def spoilt():
        for what, changed in crafted_descriptions(data):
            whole = {"level": level, "text": text} | changed if isinstance(changed, dict) else changed
            yield what, json.dumps(whole).encode()
        for what, other in {
            "no level": {},
            "damaged": level | {"levels": [{}]},
            "two": level | {"levels": level["levels"] * 2},
        }.items():
            yield what, json.dumps(data | {"level": other, "text": text}).encode()
        yield "twice", path.read_bytes() * 2
        yield from ((what, text + b"\n") for what, text in crafted_texts())

    def is_harmless(found):
        try:
            grade(found, {q.id: default_rules.answers[q.id] for q in found if q.id in default_rules.answers})
        except SegarError:
            return True
        return len(found) == 1

    assert_clean_errors(spoilt(), path, lambda: read_questions(path), is_harmless)
    assert not {name for name in set(sys.modules) - before if "passwd" in name}


def test_a_file_is_replaced_only_by_a_complete_one(files, monkeypatch):
    made, path, key = files
    before = path.read_bytes(), key.read_bytes()
    unanswered = [question for question in made.of("plan")[3:5]]
    with pytest.raises(SegarError, match="have no answers, and the key must have all"):
        write_questions(path, unanswered, {})
    with pytest.raises(SegarError, match="the questions cannot be written"):
        write_questions(path.parent / "nowhere" / "q.jsonl", unanswered, made.answers)
    assert (path.read_bytes(), key.read_bytes()) == before
    assert {one.name for one in path.parent.iterdir()} == {path.name, key.name}


def test_the_command_writes_what_the_library_makes_and_grades_it(capsys, tmp_path):
    path, space = tmp_path / "q.jsonl", "segar.rules.templates:dynamics_space"
    call = f"queries write objectsx1-hard --world {space} -n 2 --seed 5 --kinds explain predict --json"
    assert cli.main([*call.split(), "-o", str(path)]) == 0
    said = json.loads(capsys.readouterr().out)
    assert said["questions"] == {"explain": 2, "predict": 2} and said["file"] == str(path) and said["seed"] == 5
    world = segar.World(rules=segar.rules.templates.dynamics_space())
    distribution = segar.family("objectsx1-hard").with_rules(world.space)
    made, answers = make_questions(distribution, 2, ["explain", "predict"], seed=5)
    assert said["distribution"] == distribution.hash and lines_of(path) == [question.data() for question in made]
    key = tmp_path / "q.key.jsonl"
    assert lines_of(key) == [{"id": question.id, "answer": answers[question.id]} for question in made]
    assert cli.main(["queries", "grade", str(path), str(key), "--world", space, "--json"]) == 0
    graded = json.loads(capsys.readouterr().out)
    assert graded["kinds"]["all"]["correct"] == 1.0 and graded["kinds"]["explain"]["answered"] == 2
    assert graded["missing"] == [] and graded["marks"][made[0].id] == {"correct": True, "score": 1.0}
    write_lines(key, lines_of(key)[:1])
    assert cli.main(["queries", "grade", str(path), str(key), "--world", space]) == 0
    printed = capsys.readouterr().out
    assert "3 questions have no answer and count as wrong" in printed and made[-1].id in printed
    assert cli.main(["queries", "grade", str(path), str(key)]) == 2
    assert "--world" in capsys.readouterr().err
