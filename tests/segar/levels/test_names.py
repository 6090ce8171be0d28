"""Within the levels of one layout, a name belongs to one class; between layouts, names that results are keyed by do, too."""

from types import SimpleNamespace

import numpy as np
import pytest

import segar
from segar import GoalTile, GolfBall, LevelDistribution, Levels, Parameter, Position, Prior, RandomUniformLocation
from segar.envs import VectorEnv
from segar.errors import FactorError, LevelError
from segar.language import ID, Layout, Slot
from segar.metrics import decompose, ks, ks_by_factor, ks_report, w2
from segar.observations import StateVector


def lab(module: str) -> SimpleNamespace:
    """What a module of this name defines: a world parameter, a factor, and entities that have it."""
    names: dict = {"__name__": module}
    exec(
        "import segar\n"
        "class Draught(segar.Parameter, default=1.0): ...\n"
        "class Nectar(segar.Scalar, default=0.5): ...\n"
        f"class {module.title()}Flower(segar.Tile):\n    nectar: Nectar\n"
        "class Flower(segar.Tile):\n    nectar: Nectar\n",
        names,
    )
    own = names[f"{module.title()}Flower"]
    return SimpleNamespace(Draught=names["Draught"], Nectar=names["Nectar"], Own=own, Flower=names["Flower"])


NORTH, SOUTH = lab("north"), lab("south")


def distribution(*numbers, **parameters) -> LevelDistribution:
    return LevelDistribution(
        numbers=[(GolfBall, 1), (GoalTile, 1), *((kind, 1) for kind in numbers)],
        priors=[Prior(Position, RandomUniformLocation())],
        **parameters,
    )


@pytest.mark.parametrize(
    ("what", "make"),
    [
        ("factors.*'Nectar'", lambda: distribution(NORTH.Own, SOUTH.Own)),
        ("factors.*'Nectar'", lambda: Levels.from_entities([[NORTH.Own({ID: "one"}), SOUTH.Own({ID: "two"})]])),
        ("factors.*'Nectar'", lambda: Layout((Slot("a", (NORTH.Own,)), Slot("b", (SOUTH.Own,))))),
        ("entity types.*'Flower'", lambda: distribution(NORTH.Flower, SOUTH.Flower)),
        ("world parameters.*'Draught'", lambda: distribution(parameters={NORTH.Draught: 1.0, SOUTH.Draught: 2.0})),
        (
            "world parameters.*'Draught'",
            lambda: Levels.from_entities([[GolfBall()]], parameters={NORTH.Draught: 1.0, SOUTH.Draught: 2.0}),
        ),
    ],
)
def test_two_classes_of_one_name_in_one_level_set_are_refused_with_both_modules(what, make):
    with pytest.raises(LevelError, match=rf"two {what}: north\.\w+ and south\.\w+; give one of them another name"):
        make()


def test_a_factor_and_a_world_parameter_may_have_one_name():
    class Friction(Parameter, default=3.0): ...

    levels = Levels.from_entities([[GolfBall(), GoalTile()]], parameters={Friction: 3.0})
    shown = VectorEnv(levels, 1, observation=StateVector(entities=[], parameters=["Friction"]), seed=0)
    observation, info = shown.reset()
    assert observation.item() == 3.0
    assert np.isfinite(info["factors"]["Friction"][0, 1])


def test_results_by_name_of_two_sets_are_refused_where_the_sets_have_two_classes_of_a_name():
    a, b = (distribution(parameters={one.Draught: segar.UniformNoise(0, 1)}).sample(4) for one in (NORTH, SOUTH))
    assert w2(a, b) > 0 and ks(a, b) > 0  # which need no names
    parts = decompose(a, b)
    for by_name in (
        lambda: ks_by_factor(a, b),
        lambda: ks_report(a, b, rng=np.random.default_rng(0)),
        lambda: parts.by_factor,
        lambda: parts.by_name,
    ):
        with pytest.raises(LevelError, match=r"'Draught': north\.Draught and south\.Draught"):
            by_name()
    assert sum(parts.by_entity.values()) == pytest.approx(parts.value**2)
    c, d = (distribution(one.Flower).sample(4) for one in (NORTH, SOUTH))
    for by_name in (lambda: ks_by_factor(c, d), lambda: decompose(c, d).by_entity, lambda: decompose(c, d).by_name):
        with pytest.raises(LevelError, match=r"entity types in .*'Flower': north\.Flower and south\.Flower"):
            by_name()


@pytest.mark.parametrize(("one", "value"), [(NORTH, 2.0), (SOUTH, 3.0)], ids=["north", "south"])
def test_a_name_in_an_option_means_the_class_that_the_levels_have(one, value):
    levels = distribution(one.Own, parameters={one.Draught: value}).sample(1)
    flower = levels.layout.names[2]
    seen = StateVector(
        entities=[flower], factors=["Nectar"], parameters=["Draught"], scale={"Draught": 2.0, "Nectar": 4}
    )
    np.testing.assert_allclose(VectorEnv(levels, 1, observation=seen, seed=0).reset()[0], [[0.125, value / 2]])
    hiding = StateVector(entities=[flower], hidden=["Nectar"]).bind(levels, 1)
    assert f"{flower}.Nectar" not in hiding.names and f"{flower}.Nectar" in StateVector().bind(levels, 1).names


def test_a_name_of_which_the_levels_do_not_say_what_it_means_is_refused_with_both_modules():
    levels = distribution().sample(1)
    for option in ({"parameters": ["Draught"]}, {"factors": ["Nectar"], "form": "table"}):
        with pytest.raises(FactorError, match=r"several classes are called '\w+' \(.*north\.\w+, south\.\w+.*\)"):
            StateVector(**option).bind(levels, 1)
