"""Which rule is more specific: the table in docs/reference/conflicts.md against the code, row by row, and its invariants."""

import itertools
import re
from typing import Any, Tuple  # as the paper writes rules

import pytest

import segar
import segar.language
import segar.rules
from segar import GoalTile, GolfBall, Levels, Mass, Mobile, Object, Position, SetFactor, Size, rule
from segar.language import ID, Label, Rule, Thing, as_relation, is_equal
from tests.places import ROOT
from tests.segar.engine.worlds import after, read

PAGE = ROOT / "docs" / "reference" / "conflicts.md"
ROW = re.compile(r"^\| (.*?) \| (.*?) \| `(.*)` \|$", re.M)
ROWS = [(what, number, example.replace(r"\|", "|")) for what, number, example in ROW.findall(PAGE.read_text())]
LANGUAGE = {name: getattr(segar.language, name) for name in dir(segar.language)}
COMPUTED = {"relation=is_on & is_equal(Mobile, True)": 1 + 2, "relation=is_on | is_equal(Mobile, True)": max(1, 2)}


def made_from(example: str) -> Rule:
    """The rule that an entry of the table describes: a built-in one, an argument's hint, or an argument of ``rule``."""

    def on_two(body: Tuple[Mass], other: Tuple[Mass]) -> SetFactor[Mass]:
        return None

    def on_one(body) -> None: ...

    if "=" in example.split("(")[0]:
        return eval(f"rule({example})", {**LANGUAGE, "rule": rule})(on_two)
    if example.startswith("body: "):
        on_one.__annotations__["body"] = eval(example.removeprefix("body: "), {**LANGUAGE, "Tuple": Tuple})
        return rule(on_one)
    return getattr(segar.rules, example)


@pytest.mark.parametrize(("what", "number", "example"), ROWS, ids=[row[2] for row in ROWS])
def test_the_table_says_what_the_code_does(what, number, example):
    expected = {"as given": 12}.get(number, COMPUTED.get(example))
    assert made_from(example).priority == (int(number) if expected is None else expected), what


def on_factors(size: Size) -> SetFactor[Size]:
    return SetFactor[Size](size, 0.1)


def on_all(size: Size) -> SetFactor[Size]:
    return SetFactor[Size](size, 0.15)


def on_a_thing(body: Thing) -> SetFactor[Size]:
    return SetFactor[Size](body[Size], 0.2)


def on_an_object(body: Object) -> SetFactor[Size]:
    return SetFactor[Size](body[Size], 0.3)


def on_a_ball(body: GolfBall) -> SetFactor[Size]:
    return SetFactor[Size](body[Size], 0.4)


def is_light(body: Tuple[Mass]) -> bool:
    return body[0] < 5


def where_(relation: Any, value: float) -> Rule:
    def conditioned(size: Size) -> SetFactor[Size]:
        return SetFactor[Size](size, value)

    return rule(relation=relation)(conditioned)


RANKED = [  # each rule and the size that it sets; each beats the one before it
    (rule(on_factors), 0.1),
    (where_(is_light, 0.5), 0.5),
    (where_(is_equal(Mobile, True), 0.6), 0.6),
    (where_(as_relation(is_light) & is_equal(Mobile, True), 0.7), 0.7),
    (rule(on_a_thing), 0.2),
    (rule(on_an_object), 0.3),
    (rule(on_a_ball), 0.4),
    (where_(is_equal(Label, "golfball"), 0.8), 0.8),
    (where_(is_equal(ID, "golfball"), 0.9), 0.9),
    (rule(priority=12)(on_all), 0.15),
]
LEVELS = Levels.from_entities([[GolfBall(), GoalTile({Position: (0.8, 0.8)})]])


@pytest.mark.parametrize("engine", ["interpreter", "source"])
def test_of_two_rules_the_more_specific_one_wins_in_either_order(engine):
    assert [r.priority for r, _ in RANKED] == sorted({r.priority for r, _ in RANKED})
    for (weaker, _), (stronger, size) in itertools.pairwise(RANKED):
        for rules in ([weaker, stronger], [stronger, weaker]):
            state = after(engine, rules, LEVELS)
            assert read(state, LEVELS, Size)[0, 0] == size, (weaker, stronger)
