"""Grades: the truth gets 1, the laws that the scale begins with get 0, and nearer laws get more."""

import copy

import numpy as np
import pytest

import segar.engine.simulator
from segar.envs.vector import world_of
from segar.errors import SegarError
from segar.lab import Grader, Lab
from segar.lab.laws import bits_of, law_in, levels_of
from segar.levels import active_options
from segar.metrics import dynamics_w2
from segar.rules.templates import dynamics_space, law_space
from tests.segar.lab.conftest import DISTRIBUTION, SPACE, WORLD


@pytest.fixture
def truth(lab):
    return law_in(lab.hidden, SPACE)


def with_force(law, **constants):
    changed = copy.deepcopy(law)
    changed["options"]["force"] |= {f"force_{name}": value for name, value in constants.items()}
    return changed


def test_exponents_are_told_apart_in_their_order(grader, truth):
    exponents = (1.5, 1.5000001, 1.51, 1.618, 2.0)
    scores = [grade.score.value for grade in grader.grades([with_force(truth, exponent=e) for e in exponents])]
    assert scores[0] == 1.0 and (np.diff(scores) < 0).all() and scores[-1] > 0


def test_the_truth_gets_all_and_the_better_of_no_law_and_the_default_physics_nothing(grader, lab, truth):
    right, empty = grader.grades([truth, {"options": {}}])
    assert right.score == (1.0, 1.0, 1.0) and right.precision == right.recall == 1.0
    assert set(right.errors.values()) == {0.0} and right.errors.keys() == {
        "force_strength",
        "force_exponent",
        "drag_coefficient",
    }
    for name, parts in empty.distances.items():
        assert parts["law"] == pytest.approx(parts["empty"]) and parts["empty"] > 0
        share = parts["empty"] / min(parts["empty"], parts["default"])
        assert empty.scores[name].value == pytest.approx(max(0.0, 1 - share))
    assert empty.precision is None and empty.recall == 0.0 and empty.bits == 0.0


def test_distances_are_those_of_dynamics_w2(grader, lab, truth):
    law = with_force(truth, exponent=2.5)
    grade, rng = grader.grade(law), np.random.default_rng(0)
    for name, situations in grader.situations.items():
        for key, levels in (("law", levels_of(lab, [law])), ("default", lab.default_physics)):
            found = dynamics_w2(lab.hidden, levels, situations, rng=rng, resamples=2)
            assert grade.distances[name][key] == pytest.approx(found.value, rel=1e-12)


def test_intervals_hold_the_score_and_come_from_levels(grader, truth):
    grade = grader.grade(with_force(truth, exponent=2.5))
    for one in (grade.score, *grade.scores.values()):
        assert 0 <= one.low <= one.value <= one.high <= 1
    assert grade.score.low < grade.score.high and grade.data()["score"]["value"] == grade.score.value


def test_options_and_constants_are_compared(grader, truth):
    law = {
        "options": {"force": {"force_strength": 0.75, "force_exponent": 1.0}, "field": {"field_x": 0.5, "field_y": 0.0}}
    }
    grade = grader.grade(law)
    assert grade.precision == grade.recall == 0.5
    assert grade.errors == {
        "force_strength": abs(0.75 - truth["options"]["force"]["force_strength"]),
        "force_exponent": 0.5,
    }
    assert grade.bits == pytest.approx(2 * np.log2(4) + (2 + 1 + 1 + 1) * np.log2(10))


def test_round_numbers_are_shorter(lab, truth):
    lengths = [bits_of(lab, with_force(truth, exponent=e)) for e in (1.5, 1.51, 1.618, 1.5000001)]
    assert lengths == sorted(lengths) and len(set(lengths)) == 4


def test_many_laws_are_graded_without_a_new_kernel(grader, lab, monkeypatch):
    asked, running = set[str](), segar.engine.simulator.running_kernel
    monkeypatch.setattr("segar.engine.simulator.running_kernel", lambda one: asked.add(one.text) or running(one))
    levels = DISTRIBUTION.sample(30, seed=5)
    grades = grader.grades([law_in(levels[k], SPACE) for k in range(30)])
    player = lab.player(lab.hidden).source
    assert len(grades) == 30 and asked <= {player.text}
    assert 0 < max(grade.score.value for grade in grades) < 1


BAD_LAWS = [
    ([], "'law' must be a mapping"),
    ({}, "'law.options' is absent"),
    ({"options": {"forse": {}}}, r"'law.options.forse' is not known. Did you mean 'force\?'|'law.options.forse' is not known"),
    ({"options": {"drag": {}}}, "'law.options.drag.drag_coefficient' is absent"),
    ({"options": {"drag": {"drag_coefficient": 1.0, "mass": 1.0}}}, "'law.options.drag.mass' is not known"),
    ({"options": {"drag": {"drag_coefficient": "1"}}}, "'law.options.drag.drag_coefficient' must be float, not '1'"),
    ({"options": {"drag": {"drag_coefficient": 2.5}}}, "drag_coefficient' is 2.5, and must be from 0.25 to 2"),
    ({"code": "import os"}, "'law.code': this lab does not trust code"),
]  # fmt: skip


@pytest.mark.parametrize(("law", "said"), BAD_LAWS)
def test_a_law_that_is_none_is_named(lab, law, said):
    with pytest.raises(SegarError, match=said):
        levels_of(lab, [law])


def test_options_that_exclude_each_other_are_named(lab):
    gate = {"gate_x": 0.3, "gate_y": 0.3, "gate_to_x": -0.5, "gate_to_y": 0.0, "gate_radius": 0.1}
    with pytest.raises(SegarError, match="field and gate never hold together"):
        levels_of(lab, [{"options": {"gate": gate, "field": {"field_x": 0.0, "field_y": 0.0}}}])


CODE = """
from typing import Tuple
from segar import Aggregate, Mass, Position, Velocity, rule
from segar.language import Acceleration, where

@rule
def drag(v: Velocity, m: Mass, a: Acceleration) -> Aggregate[Acceleration]:
    return Aggregate[Acceleration](a, v * where(m != 0, -{drag} / m, 0.0))

def force(one: Tuple[Position, Mass], other: Tuple[Position, Mass, Acceleration]) -> Aggregate[Acceleration]:
    (x1, m1), (x2, m2, a) = one, other
    away = x2 - x1
    r2 = away.dot(away)
    return Aggregate[Acceleration](a, away * where((r2 != 0) & (m2 != 0), {force} * m1 * m2 * r2 ** -1.25 / m2, 0.0))
"""


def test_code_is_graded_where_it_is_trusted(truth):
    trusting = Lab(DISTRIBUTION, world=WORLD, trusted=True)
    options = truth["options"]
    code = CODE.format(drag=options["drag"]["drag_coefficient"], force=options["force"]["force_strength"])
    levels = levels_of(trusting, [{"code": code}])
    assert [rule.name for rule in world_of(levels).rules[-2:]] == ["drag", "force"]
    assert bits_of(trusting, {"code": code}) > bits_of(trusting, truth)
    for text, said in (("x = (", "SyntaxError"), ("1 / 0", "ZeroDivisionError"), ("x = 1", "defines no rule")):
        with pytest.raises(SegarError, match=said):
            levels_of(trusting, [{"code": text}])
    with pytest.raises(SegarError, match="graded alone"):
        levels_of(trusting, [truth, {"code": code}])


@pytest.mark.slow
def test_code_that_is_the_truth_gets_all(truth):
    options = truth["options"]
    code = CODE.format(drag=options["drag"]["drag_coefficient"], force=options["force"]["force_strength"])
    grade = Grader(Lab(DISTRIBUTION, world=WORLD, trusted=True)).grade({"code": code})
    assert grade.score.value > 1 - 1e-9 and grade.precision is grade.recall is None


def test_hidden_worlds_have_combinations_that_no_training_world_has():
    known = dynamics_space().split("train").combinations
    labs = [Lab(DISTRIBUTION.with_rules(law_space()), world=k).hidden for k in range(2)]
    for level in labs:
        active = active_options(level)
        assert active[:, 29:].any() or np.isinf(known.log_prob(active[:, :29])).all()
