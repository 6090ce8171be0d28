"""Answers are what the simulator says; an environment agrees, and naive answers get little."""

from dataclasses import replace

import numpy as np
import pytest

import segar
from segar.errors import SegarError
from segar.lab import Session
from segar.lab.laws import law_in
from segar.lab.questions import SORTS, draw_actions, make_questions, steady_players
from tests.segar.lab.conftest import SPACE, replayed

NUMBER = 8  # of questions of each kind


@pytest.fixture(scope="module")
def asking(lab):
    return replace(lab, questions=NUMBER)


@pytest.fixture(scope="module")
def questions(asking):
    return make_questions(asking)


def of(questions, *kinds):
    return [question for question in questions if question.ask["kind"] in kinds]


def asked(lab, ask, state):
    layout = lab.hidden.layout
    factor = layout.factor(ask["factor"])
    value = state[layout.slot_index(ask["entity"]), layout.columns[factor] : layout.columns[factor] + factor.width]
    return value.tolist() if factor.width > 1 else float(value[0])


def true_answer(lab, ask):
    """What an environment says."""
    actions, change = [list(action) for action in ask["actions"]], ask.get("change", {})
    if "action" in change:
        actions[change["action"]["step"] - 1] = change["action"]["value"]
    constants = {name: value for own in change.get("option", {}).values() for name, value in own.items()}
    options = {f"{name}_active": 1.0 for name in change.get("option", {})}
    states, _ = replayed(lab, ask, actions, change.get("set"), change.get("parameter", {}) | constants | options)
    return asked(lab, ask, states[ask["step"]])


def test_there_are_so_many_of_each_kind_each_about_a_level_of_its_own(asking, questions):
    assert [q.ask["kind"] for q in questions] == ["predict"] * NUMBER + ["plan"] * NUMBER + ["counterfactual"] * NUMBER
    assert len({q.ask["level"] for q in questions}) == len(questions) and min(q.ask["level"] for q in questions) >= 16


@pytest.mark.parametrize("kind", ["predict", "counterfactual"])
def test_an_environment_knows_the_numbers(asking, questions, kind):
    for question in of(questions, kind):
        assert question.mark(true_answer(asking, question.ask)) == (True, 1.0), question.ask


def test_each_sort_of_change_is_known_to_an_environment(asking):
    """Those that are seldom a good question are tried by themselves."""
    rng, values = np.random.default_rng(0), asking.levels.values[20]
    fact, index = (asking.hidden, values, draw_actions(asking.task, 10, rng)), 20
    for sort, key in zip(SORTS, ("set", "action", "parameter", "option"), strict=True):
        change, (laws, first, actions) = next(found for found in (sort(asking, fact, rng) for _ in range(50)) if found)
        assert list(change) == [key]
        seen = asking.play(laws, np.array([index]), first[None], actions[None].astype(np.float32), range(first.size))
        ask = {
            "level": index,
            "actions": fact[2],
            "change": change,
            "step": 10,
            "entity": "golfball",
            "factor": "Position",
        }
        assert true_answer(asking, ask) == asked(asking, ask, seen.seen[0, 0, -1].reshape(first.shape))


@pytest.mark.parametrize("kind", ["predict", "counterfactual"])
def test_who_says_that_nothing_moves_or_changes_is_never_right(asking, questions, kind):
    for question in of(questions, kind):
        states, _ = replayed(asking, question.ask, question.ask["actions"])
        seen = states[len(question.ask["observations"]) - 1]
        mark = question.mark(asked(asking, question.ask, seen))
        assert not mark.correct and mark.score <= np.exp(-3)


def test_scores_fall_with_the_error_and_answers_are_right_up_to_the_tolerance(asking, questions):
    question = next(q for q in of(questions, "predict", "counterfactual") if q.ask["factor"] == "Position")
    (x, y), scale = np.ravel(true_answer(asking, question.ask)), question.ask["scale"]
    for error in (0.0, 0.049, 0.051, 0.1, 1e300):
        mark = question.mark([x + error, y])
        assert mark.correct == (error <= 0.05) and mark.score == pytest.approx(np.exp(-error / scale), abs=1e-12)


def test_plans_that_work_in_an_environment_are_right_and_steady_pushes_are_not(asking, questions):
    rng, right = np.random.default_rng(0), 0
    for question in of(questions, "plan")[:4]:
        tried = [draw_actions(asking.task, question.ask["steps"], rng) for _ in range(3)]
        for actions in (*tried, *steady_players(asking.task, question.ask["steps"])):
            works = replayed(asking, question.ask, actions)[1]
            assert question.mark(actions.tolist()) == (works, float(works))
            right += works
        plan = segar.hardness.plan(
            replace(asking.levels[question.ask["level"]], parameters=asking.hidden.parameters), asking.task, rng=rng
        )
        actions = plan.actions[0, : plan.steps[0]].tolist()
        assert plan.steps[0] > question.ask["steps"] or question.mark(actions).correct
        assert not question.mark(actions[:0]).correct and not question.mark([[0.0, 0.0]] * 500 + actions).correct
    assert right <= 2


def test_the_true_law_answers_in_a_session_and_what_is_missing_is_wrong(asking):
    session = Session(asking)
    truth = law_in(asking.hidden, SPACE)
    asks = [ask for ask in session.answer()["questions"] if ask["kind"] == "predict"]
    answers = {}
    for ask in asks[1:]:
        seen = session.predict(truth, level=ask["level"], actions=ask["actions"])
        at = [
            list(asking.places).index(name)
            for name in asking.places
            if name.startswith(f"{ask['entity']}.{ask['factor']}")
        ]
        answers[ask["id"]] = seen[-1, at].tolist() if len(at) > 1 else float(seen[-1, at[0]])
    with pytest.raises(SegarError, match=f"'answers.{asks[1]['id']}"):
        session.answer(answers=answers | {asks[1]["id"]: "x"})
    with pytest.raises(SegarError, match="the experiments are over"):
        session.experiment(steps=1)
    found = session.answer(answers=answers)
    assert [found["marks"][ask["id"]]["correct"] for ask in asks] == [False] + [True] * (NUMBER - 1)
    assert found["correct"]["value"] == found["score"]["value"] == (NUMBER - 1) / (3 * NUMBER)
    assert found["correct"]["low"] < found["correct"]["value"] < found["correct"]["high"]
    with pytest.raises(SegarError, match="answers no question that waits"):
        session.answer(answers=answers)


WRONG = {
    "predict": [("x", "must be"), ([1.0], "must be two numbers, not 1|must be float"), ([1.0, None], r"must be float")],
    "plan": [([[1.0]], r"\[0\]' must be 2 numbers, not 1"), ([1.0, 2.0], r"\[0\]' must be"), ("up", "must be a list")],
}


@pytest.mark.parametrize("kind", WRONG)
def test_an_answer_of_another_form_is_named(questions, kind):
    question = of(questions, kind)[0]
    for answer, said in WRONG[kind]:
        with pytest.raises(SegarError, match=rf"'answers.{question.ask['id']}.*({said})"):
            question.mark(answer)
    assert question.mark(None) == (False, 0.0)


def test_too_few_good_levels_are_said(asking, monkeypatch):
    monkeypatch.setitem(make_questions.__globals__["KINDS"], "plan", lambda *_: None)
    with pytest.raises(SegarError, match=f"only 0 of {NUMBER} questions of the kind 'plan' were found on"):
        make_questions(asking)
