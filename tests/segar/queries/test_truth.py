"""Answers are what the simulator says; other implementations of the same physics agree, and naive answers get little."""

from dataclasses import replace

import numpy as np
import pytest

import segar
from segar.errors import SegarError
from segar.levels import active_options
from segar.queries import KINDS, ActionChange, FactorChange, ParameterChange, RuleChange, grade, make_questions
from segar.queries.changes import change_of
from segar.queries.kinds import steady_players
from segar.queries.making import LARGEST_SHARE
from segar.queries.trajectories import Player


def replayed(question, actions, level=None):
    """The states that an environment goes through, float64 ``(steps, entities, columns)``, and whether there was success."""
    env = segar.envs.VectorEnv(level or question.level, 1, task=question.task, seed=7, autoreset_mode="Disabled")
    env.reset(options={"levels": [0]})
    states, success = [], False
    for action in np.asarray(actions, np.float32):
        _, _, terminated, _, info = env.step(action[None])
        states.append(env.state().state.values[0])
        success |= bool(info["success"][0])
        if terminated[0]:
            break
    return np.array(states), success


def asked(question, state):
    """The value that is asked for, in a state ``(entities, columns)``."""
    layout, factor = question.level.layout, question.level.layout.factor(question.ask["factor"])
    column = layout.columns[factor]
    value = state[layout.slot_index(question.ask["entity"]), column : column + factor.width].tolist()
    return value if len(value) == 2 else value[0]


def marks(questions, answers, kind):
    return np.array([(m.correct, m.score) for m in grade(questions, answers).of(kind)]).mean(axis=0)


def test_the_truth_gets_all_marks(made):
    found = grade(made.questions, made.answers)
    assert len(found.marks) == 20 * len(KINDS) and not found.missing
    assert all(mark == (True, 1.0) for mark in found.marks.values())
    assert found.correct().value == found.score().value == found.correct().high == 1.0 > found.correct().low


def test_an_environment_agrees_to_the_bit_about_what_comes(made):
    for question in made.of("predict"):
        states, _ = replayed(question, [*question.actions, *question.ask["actions"]])
        assert asked(question, states[question.ask["step"] - 1]) == made.answers[question.id]


def test_an_environment_in_which_one_intervenes_agrees_about_what_would_be(made):
    count = 0
    for question in made.of("counterfactual"):
        change = change_of(question.ask["change"], "")
        actions = question.actions.astype(np.float32)
        env = segar.envs.VectorEnv(question.level, 1, task=question.task, seed=1, autoreset_mode="Disabled")
        env.reset(options={"levels": [0]})
        if isinstance(change, FactorChange):
            env.intervene(change.entity, question.level.layout.factor(change.factor), change.value)
        elif isinstance(change, ActionChange):
            actions[change.step - 1] = change.action
        else:
            continue
        for action in actions[: question.ask["step"]]:
            env.step(action[None])
        assert asked(question, env.state().state.values[0]) == made.answers[question.id]
        count += 1
    assert count > 5


@pytest.mark.slow
@pytest.mark.usefixtures("plain_source")
def test_a_rule_that_is_switched_off_is_a_rule_that_is_not_there(rule_space):
    space, count = rule_space.distribution.rule_space, 0
    for question in rule_space.of("explain"):
        active = [name for name, on in zip(space.names, active_options(question.level)[0], strict=True) if on]
        for name in active:
            rest = [other for other in active if other != name]
            off, _ = RuleChange(name, False).applied(question.level, question.actions)
            assert [n for n, on in zip(space.names, active_options(off)[0], strict=True) if on] == rest
            count += 1
    world = segar.World(space.rules_of(rest), on_contact=space.on_contact_of(rest))
    alone = Player(question.task).play(replace(off, world=world), question.actions)
    assert np.array_equal(
        Player(question.task).play(off, question.actions).states, alone.states, equal_nan=True
    ) and count > 20  # fmt: skip


def test_one_alternative_and_no_other_leads_to_the_second_history(made):
    for question in made.of("explain"):
        player, column = Player(question.task), question.level.layout.columns[segar.language.Position]
        histories = [player.play(question.level, question.actions).states[0]]
        for data in question.ask["alternatives"].values():
            histories.append(player.play(*change_of(data, "").applied(question.level, question.actions)).states[0])
        places = np.stack(histories)[:, :, :, column : column + 2]
        apart = np.nanmax(np.linalg.norm(places[:, None] - places[None], axis=-1), axis=(2, 3))
        assert (apart + np.eye(len(places)) >= 0.05).all()
        named = list(question.ask["alternatives"]).index(made.answers[question.id])
        for line, state in zip(question.ask["states"], histories[1 + named][1:], strict=True):
            for entity, factors in line.items():
                slot = question.level.layout.slot_index(entity)
                assert factors["Position"] == state[slot, column : column + 2].tolist()


def test_plans_work_in_an_environment(made):
    for question in made.of("plan"):
        assert len(made.answers[question.id]) <= question.ask["steps"]
        assert replayed(question, made.answers[question.id])[1]


def test_no_alternative_is_right_more_often_than_by_chance(made):
    """Each question has one right letter of four: over the letters, shares sum to 1; and the letter is drawn evenly."""
    questions = made.of("explain")
    shares = [marks(questions, dict.fromkeys((q.id for q in questions), letter), "explain")[0] for letter in "ABCD"]
    assert sum(shares) == 1.0
    assert max(shares) < 0.25 + 4 * (0.25 * 0.75 / len(questions)) ** 0.5  # four standard deviations


@pytest.mark.parametrize("kind", ["predict", "counterfactual"])
def test_no_constant_is_right_often(made, kind):
    """Any constant that is right for some question of a factor is near the answer of one of them: these are tried."""
    questions = made.of(kind)
    for factor in {q.ask["factor"] for q in questions}:
        same = [q for q in questions if q.ask["factor"] == factor]
        for one in same:
            correct, _ = marks(same, dict.fromkeys((q.id for q in same), made.answers[one.id]), kind)
            assert correct * len(same) <= 2 + LARGEST_SHARE * len(same)
    shares = []
    for value in np.linspace(-1, 1, 5):
        answers = {q.id: [value, value] if isinstance(made.answers[q.id], list) else value for q in questions}
        shares.append(marks(questions, answers, kind))
    assert max(correct for correct, _ in shares) <= 0.2 and max(score for _, score in shares) < 0.25


@pytest.mark.parametrize("kind", ["predict", "counterfactual"])
def test_who_says_that_nothing_moves_or_changes_is_never_right(made, kind):
    """The last value that was seen, or what was in fact, differs from the answer by three scales at least."""
    questions = made.of(kind)
    last = {q.id: asked(q, replayed(q, q.actions)[0][-1]) for q in questions}
    correct, score = marks(questions, last, kind)
    assert correct == 0 and score <= np.exp(-3)


def test_who_does_nothing_or_pushes_steadily_or_takes_the_plan_of_another_level_gets_nowhere(made):
    questions = made.of("plan")
    for player in range(len(steady_players(questions[0].task, 1))):
        answers = {q.id: steady_players(q.task, q.ask["steps"])[player].tolist() for q in questions}
        assert marks(questions, answers, "plan")[0] == 0
    others = {q.id: made.answers[r.id] for q, r in zip(questions, questions[1:] + questions[:1], strict=True)}
    assert marks(questions, others, "plan")[0] <= 0.1


def test_a_plan_counts_its_first_actions_and_no_time_after_its_last_one(default_rules):
    question = default_rules.of("plan")[0]
    right, idle = default_rules.answers[question.id], [0.0, 0.0]
    for answer, works in (
        (right + [idle] * 500, True),
        (right[:-1], False),
        ([], False),
        ([idle] * 500 + right, False),
    ):
        assert grade([question], {question.id: answer}).marks[question.id].correct == works


def test_scores_fall_with_the_error_and_answers_are_right_up_to_the_tolerance(default_rules):
    question = next(q for q in default_rules.of("predict") if q.ask["factor"] == "Position")
    (x, y), scale = default_rules.answers[question.id], question.ask["scale"]
    for error in (0.0, 0.049, 0.051, 0.1, 1e308):
        mark = grade([question], {question.id: [x + error, y]}).marks[question.id]
        assert mark.correct == (error <= 0.05) and mark.score == pytest.approx(np.exp(-error / scale), abs=1e-12)


def test_an_answer_of_another_form_is_refused(default_rules):
    question = default_rules.of("plan")[0]
    with pytest.raises(SegarError, match=f"question '{question.id}': 'answer' must be a list of a list"):
        grade([question], {question.id: 3})


def test_a_missing_answer_counts_as_wrong_and_is_told(default_rules):
    some = {q.id: default_rules.answers[q.id] for q in default_rules.of("predict", "plan")[5:]}
    found = grade(default_rules.questions, some)
    assert len(found.missing) == 5 + 20 + 20
    assert (
        found.correct("predict").value == 0.75 and found.correct("explain").value == 0.0 == found.correct("explain").low
    )
    assert found.correct().value == found.score().value == 35 / 80


def test_none_is_no_answer_and_kinds_that_were_not_asked_are_refused(default_rules):
    questions = default_rules.of("plan")[:2]
    found = grade(questions, {questions[0].id: None, questions[1].id: default_rules.answers[questions[1].id]})
    assert found.missing == (questions[0].id,) and found.correct("plan").value == 0.5
    for kind, said in (("predict", "no question is of the kind 'predict'"), ("plann", "Did you mean 'plan'")):
        with pytest.raises(SegarError, match=said):
            found.correct(kind)
        with pytest.raises(SegarError, match=said):
            found.score(kind)
    with pytest.raises(SegarError, match="no question was graded"):
        grade([], {}).correct()


def test_a_question_depends_on_its_level_alone(default_rules):
    """Neither the number of questions nor the other kinds matter; another seed asks about other levels."""
    few, answers = make_questions(default_rules.distribution, 4, ["explain", "predict"], seed=3)
    assert [q.kind for q in few] == ["predict"] * 4 + ["explain"] * 4
    for kind in ("predict", "explain"):
        for one, other in zip([q for q in few if q.kind == kind], default_rules.of(kind)[:4], strict=True):
            assert one.data() == other.data() and answers[one.id] == default_rules.answers[one.id]
    assert make_questions(default_rules.distribution, 1, ["predict"], seed=4)[0][0].text != few[0].text
    levels = [q.level.provenance.indices[0] for q in default_rules.questions]
    assert len(set(levels)) == len(levels)


def test_changes_of_numbers_can_be_taken_back(made):
    question = made.of("predict")[0]
    for there, back in (
        (FactorChange("golfball", "Mass", 2.0), FactorChange("golfball", "Mass", 1.0)),
        (ParameterChange("FloorFriction", 0.5), ParameterChange("FloorFriction", 0.05)),
    ):
        changed, actions = there.applied(question.level, question.actions)
        assert changed != question.level
        assert back.applied(changed, actions)[0] == question.level


def test_rules_that_draw_numbers_are_refused():
    @segar.rule
    def tremble(v: segar.Velocity) -> segar.Differential[segar.Velocity]:
        return segar.Differential[segar.Velocity](v, (segar.random.normal(), segar.random.normal()))

    with pytest.raises(SegarError, match="draws random numbers, so that nobody can know"):
        make_questions(segar.family("empty-easy").with_rules([segar.move, tremble]), 1)


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        ({"kinds": ["predict", "guess"]}, "no questions of the kind 'guess'"),
        ({"kinds": ["plan", "plan"]}, "different names"),
        ({"kinds": []}, "different names, one at least"),
        ({"kinds": "predict"}, r"kinds must be a list of names such as \['predict'\], not 'predict'"),
        ({"distribution": segar.family("empty-easy").sample(2)}, "make_questions needs a level distribution"),
        ({"number": True}, "must be a whole number above 0, not True"),
        ({"number": 0}, "must be a whole number above 0, not 0"),
        ({"seed": -1}, "seed must be a whole number that is not negative, not -1"),
        ({"task": "golf"}, "no task is called 'golf'"),
    ],
)
def test_wrong_arguments_are_named(arguments, said):
    with pytest.raises(SegarError, match=said):
        make_questions(**{"distribution": segar.family("empty-easy")} | arguments)


@pytest.mark.usefixtures("plain_source")
def test_levels_without_good_questions_are_said():
    @segar.rule
    def freeze(v: segar.Velocity) -> segar.SetFactor[segar.Velocity]:
        return segar.SetFactor[segar.Velocity](v, (0.0, 0.0))

    still = segar.family("empty-easy").with_rules([freeze])
    with pytest.raises(SegarError, match="only 0 of 1 questions of the kind 'predict' were found on 40 levels"):
        make_questions(still, 1, ["predict"])
