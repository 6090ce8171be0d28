"""The words of a question say the same numbers as its data, in six digits, and name every rule that holds."""

import re
from dataclasses import replace

import numpy as np
import pytest

import segar
from segar.language import CIRCLE, Acceleration, Drag, Position
from segar.levels import rules_in_words
from segar.queries import make_questions
from segar.queries.changes import ParameterChange, change_of
from segar.queries.trajectories import Player
from segar.queries.words import RULES, first_sentence, level_in_words, rules_of, task_in_words
from segar.rules import DEFAULT_RULES, World

NUMBER = r"-?[\d.]+(?:e[+-]?\d+)?"
FACTOR = re.compile(rf"^(\w+) (?:\(({NUMBER}), ({NUMBER})\)|({NUMBER}))(?: (\S+))?$")


def read_factor(text):
    """Name, values and unit of a factor that words state."""
    found = FACTOR.match(text)
    assert found, text
    name, x, y, single, unit = found.groups()
    return name, [float(v) for v in (x, y, single) if v is not None], unit or ""


def rounded(values):
    return [float(f"{value:.6g}") for value in np.atleast_1d(values)]


def test_all_numbers_of_all_entities_and_parameters_stand_in_the_words(made):
    for question in made.questions[::7]:
        level, data = question.level, question.data()
        [said] = data["level"]["levels"]
        lines = dict(re.findall(r"^- (\w+) \(.*?\): (.*)$", question.text, re.M))
        assert set(lines) == set(said["entities"]) - {"global_friction"}
        for name, line in lines.items():
            factors = {f: (v, u) for f, v, u in map(read_factor, line.split("; "))}
            stated = said["entities"][name]["factors"]
            assert set(stated) - set(factors) <= {"Acceleration", "Drag"}
            for factor, (values, unit) in factors.items():
                assert values == rounded(stated[factor]) and unit == data["units"][factor]
        [line] = re.findall(r"^World parameters: (.*)\.$", question.text, re.M)
        space = level.world.space if level.world else None
        drawn = {p.__name__ for p in space.parameters} if space else set()
        parameters = {f: v for f, v, _ in map(read_factor, line.split("; "))}
        assert parameters == {n: rounded(x) for n, x in said["parameters"].items() if n not in drawn}


def test_histories_in_words_have_the_numbers_of_the_data(made):
    for question in made.questions[::3]:
        data = question.data()
        stated = [data["history"]["states"], *([data["ask"]["states"]] if "states" in data["ask"] else [])]
        lines = re.findall(r"^step (\d+): action \((.*?)\); (.*)$", question.text, re.M)
        told = [
            (action, state)
            for states in stated
            for action, state in zip(data["history"]["actions"], states, strict=True)
        ]
        for (_, action, text), (acted, state) in zip(lines, told, strict=True):
            assert [float(x) for x in action.split(", ")] == acted
            for part, (entity, factors) in zip(text.split("; "), state.items(), strict=True):
                name, rest = part.split(" ", 1)
                assert name == entity
                found = [read_factor(one) for one in re.split(r", (?=[A-Z])", rest)]
                assert [(f, v, u) for f, v, u in found] == [
                    (f, rounded(v), data["units"][f]) for f, v in factors.items()
                ]


def test_what_is_asked_stands_in_the_words(made):
    for question in made.questions:
        ask, text = question.ask, question.text
        if "factor" in ask:
            unit = question.level.layout.factor(ask["factor"]).unit
            assert f"what is the {ask['factor']} of {ask['entity']} after step {ask['step']}?" in text
            assert f"its error is at most {ask['tolerance']:g} {unit}".rstrip() in text
        if question.kind == "predict":
            said = re.findall(rf"step (\d+) \(({NUMBER}), ({NUMBER})\)", text.split("The next actions are:")[1])
            assert [[float(x), float(y)] for _, x, y in said] == ask["actions"]
            assert [int(k) for k, _, _ in said] == list(range(len(question.actions) + 1, ask["step"] + 1))
        if question.kind == "plan":
            assert f"within {ask['steps']} steps" in text and f"at most {ask['steps']} actions" in text
        for data in [*ask.get("alternatives", {}).values(), *([ask["change"]] if "change" in ask else [])]:
            assert change_of(data, "").words(question.level, question.actions) in text
            if "value" in data:
                assert re.search(rf"{data.get('factor') or data['parameter']}[\w ]* is {data['value']:.6g}\b", text)


def test_the_rules_of_the_space_that_hold_are_named_and_no_others(rule_space):
    for question in rule_space.questions[::5]:
        active = rules_in_words(question.level, 0)
        named = rules_of(question.level)
        assert [text.split(". ")[0] for text in named[-len(active) :]] == [text.split(". ")[0] for text in active]
        assert all(f"- {text}\n" in question.text for text in named)


def test_a_constant_that_changes_is_told_with_its_rule(rule_space):
    level, actions = rule_space.questions[0].level, rule_space.questions[0].actions
    level = replace(level, parameters=level.parameters.copy())
    space = level.world.space
    option = space.options[space.index("vortex")]
    (strength,) = option.constants
    for parameter, value in ((option.active, 1.0), (strength, 0.5)):
        level.parameters[0, level.layout.parameters.index(parameter)] = value
    said = ParameterChange("vortex_strength", -1.0).words(level, actions)
    assert said == (
        "vortex_strength is -1 N/m instead of 0.5 N/m; it is in the rule that says now: a force -1 N/m x Mass x distance from"
        " the middle, counter-clockwise around it"
    )


def test_every_default_rule_has_words_of_its_own():
    world = World()
    assert {*DEFAULT_RULES, world.limit, world.wall_contact, world.pair_contact} == set(RULES)
    assert len({text for text in RULES.values() if text}) == len(RULES) - 1  # one is told with the one that it serves


def test_rules_that_concern_nothing_in_the_level_are_left_out():
    empty, tiles = (segar.family(name).sample(1) for name in ("empty-hard", "puttputt"))
    hole = RULES[segar.rules.consume]
    assert hole not in rules_of(empty)
    levels = segar.Levels.from_entities([[segar.GolfBall(), segar.GoalTile(), segar.Hole()]])
    assert hole in rules_of(levels) and RULES[segar.rules.collide] in rules_of(tiles[0])


def test_rules_and_tasks_of_ones_own_speak_by_their_docstrings():
    @segar.rule
    def blow(v: segar.Velocity) -> segar.Differential[segar.Velocity]:
        """The wind of :func:`nowhere` blows ``east``. It is not strong."""
        return segar.Differential[segar.Velocity](v, (1.0, 0.0))

    @segar.rule
    def hum_a_tune(m: segar.Mass) -> segar.Differential[segar.Mass]:
        return segar.Differential[segar.Mass](m, 0.0)

    def push(v: segar.Velocity, action: segar.Action) -> segar.SetFactor[segar.Velocity]:
        """The action is the new velocity."""
        return segar.SetFactor[segar.Velocity](v, segar.Velocity((action[0], 0.0)))

    def is_far(m: segar.Mass) -> bool:
        return m > 0.5

    levels = segar.family("empty-easy").with_rules([segar.move, blow, hum_a_tune]).sample(1)
    assert {"The wind of nowhere blows east.", "hum a tune"} <= set(rules_of(levels))
    words = task_in_words(
        "my_lab:push", segar.Task("push", push, success=is_far, action_low=(0.0,), action_high=(2.0,))
    )
    assert words.splitlines()[:2] == [
        "An action is one number from (0) to (2). The action is the new velocity.",
        "Success: is far.",
    ]
    assert first_sentence(is_far) == ""


def test_worlds_without_contacts_and_with_other_walls_say_so():
    world = World(rules=[segar.move], wall_contact=None, pair_contact=None, walls=2.0)
    levels = segar.Levels.from_entities([[segar.GolfBall(), segar.GoalTile()]], world=world)
    assert {"A wall stops what touches it.", "Bodies pass through each other."} <= set(rules_of(levels))
    assert "Its walls are 2 m from its centre" in level_in_words(levels, segar.puttputt())


def test_outlines_are_told():
    levels = segar.family("tilesx2-hard").sample(20, seed=0)
    seen = set()
    for level in levels:
        for slot, name in enumerate(level.layout.names[:-1]):
            [line] = re.findall(rf"^- {name} (.*)$", level_in_words(level, segar.puttputt()), re.M)
            if level.shape_kind[0, slot] == CIRCLE:
                assert "a disc" in line
            else:
                corners = level.vertices[0, slot, : level.vertex_count[0, slot]]
                said = re.findall(rf"\(({NUMBER}), ({NUMBER})\)", line.split("corners at ")[1].split(" m from")[0])
                assert [[float(x), float(y)] for x, y in said] == [rounded(corner) for corner in corners]
            seen.add(int(level.shape_kind[0, slot]))
    assert len(seen) == 2


@pytest.mark.usefixtures("plain_source")
def test_what_the_words_say_of_puttputt_is_what_it_does():
    """A unit action adds 2 / Mass to the velocity; success is within 0.02828 m."""
    things = [
        [segar.GolfBall({Position: (x, 0.0), segar.Mass: 4.0}), segar.GoalTile({Position: (0.0, 0.0)})]
        for x in (0.0282, 0.0284)
    ]
    levels = segar.Levels.from_entities(things, world=World(rules=[segar.rules.accelerate]))
    found = Player(segar.puttputt()).play(levels, np.array([[1.0, -0.5]]))
    assert found.solved.tolist() == [1, 2]
    column = levels.layout.columns[segar.Velocity]
    assert found.states[:, 1, 0, column : column + 2].tolist() == [[0.5, -0.25]] * 2


def test_factors_that_rules_find_anew_are_told_only_where_a_level_begins_with_them():
    levels = segar.Levels.from_entities([[segar.GolfBall({Acceleration: (1.0, 2.0)}), segar.GoalTile()]])
    text = level_in_words(levels, segar.puttputt())
    assert "Acceleration (1, 2) m/s^2" in text and Drag.__name__ not in text


@pytest.mark.parametrize("name", ["billiards", "invisiball", "tilesx1-hard"])
def test_questions_can_be_asked_about_other_families(name):
    questions, answers = make_questions(segar.family(name), 2, ["predict", "explain", "counterfactual"], seed=1)
    assert len(questions) == len(answers) == 6
