"""Distributions as text: what is written reads back as the same distribution, and reading runs no code."""

import numpy as np
import pytest

import segar
from segar import Ball, Charge, Circle, GoalTile, Gravity, Mass, Position, Prior, Shape, Size, UniformNoise
from segar.language import RandomConvexHull
from segar.levels import TASK_LEVELS, Dependent, families, read_distribution, written
from segar.noise import Affine, Choice, Empirical, GaussianNoise, Independent, Mixture


class Warmth(segar.Scalar, default=3.0):
    """A factor of the user's own."""


class WarmBall(Ball):
    warmth: Warmth = 4.0


def weight(size: Size) -> float:
    return 25.0 * size**2


def is_large(size: Size) -> bool:
    return size > 0.25


ODD = segar.LevelDistribution(
    numbers=[(WarmBall, 2), (GoalTile, 1)],
    priors=[
        Prior(Position, Independent(UniformNoise(-0.5, 0.5), GaussianNoise(0, 0.1))),
        Prior(
            Size, Mixture([UniformNoise(0.15, 0.3), Affine(UniformNoise(0, 1), 0.1, 0.2)], [0.2, 0.8]), entity_type=Ball
        ),
        Prior(Mass, Dependent(UniformNoise(0.9, 1.1), scale=weight), entity_type=Ball),
        Prior(Mass, 2.0),
        Prior(Shape, Choice([Circle(0.1234567), RandomConvexHull(0.3)]), entity_type=GoalTile),
        Prior(Warmth, Empirical([0.1, 0.2, 0.3])),
        Prior(Charge, 1.0, relation=is_large),
    ],
    parameters={Gravity: UniformNoise(9, 11)},
    name="odd",
)


@pytest.mark.parametrize("name", [*families(), *TASK_LEVELS])
def test_a_family_reads_back_as_itself(name: str) -> None:
    family = segar.family(name)
    back = read_distribution(written(family), family)
    assert (back.hash, back.name, back.task) == (family.hash, family.name, family.task)
    assert back.sample(3, seed=5) == family.sample(3, seed=5)


def test_own_classes_formulas_and_relations_read_back() -> None:
    text = written(ODD)
    back = read_distribution(text, ODD)
    assert back.hash == ODD.hash
    assert back.sample(20) == ODD.sample(20)
    assert "# is_large is a relation" in text
    heavier = read_distribution(text.replace("low=0.9, high=1.1", "low=9.0, high=11.0"), ODD)
    mass, size = (heavier.sample(20).sampled_values[:, 0, ODD.layout.columns[factor]] for factor in (Mass, Size))
    assert np.all((mass / size**2 > 25 * 8.9) & (mass / size**2 < 25 * 11.1))


def test_an_edited_distribution_keeps_rules_and_task_and_says_that_it_was_edited() -> None:
    family = segar.family("billiards").with_rules(segar.DEFAULT_RULES)
    back = read_distribution(written(family).replace("std=0.01", "std=0.02"), family)
    assert (back.world, back.task, back.name) == (family.world, "billiards", "billiards, edited")


HEAD = "LevelDistribution(\n numbers=[(GolfBall, 1)],\n priors=[Prior(Mass, {})])"


@pytest.mark.parametrize(
    ("text", "why"),
    [
        ("", "line 1: this is no Python expression"),
        ("LevelDistribution(\n numbers=[(GolfBall, 1),\n", "line 2: this is no Python expression"),
        ("3", "line 1: the text must be LevelDistribution"),
        ("LevelDistribution([(GolfBall, 1)])", "line 1: name the parts"),
        ("LevelDistribution(**{})", "has no part 'None'"),
        ("LevelDistribution()", "needs numbers="),
        ("LevelDistribution(\nnumbers=[(GolfBall, 1)],\nnumber=3)", "line 3: LevelDistribution has no part 'number'"),
        ("LevelDistribution(numbers=[(GolfBall, 1)],\nnumbers=[])", "line 2: 'numbers' is given twice"),
        ("LevelDistribution(\n numbers=[(GolfBal, 1)])", "line 2: there is no 'GolfBal' here."),
        ("LevelDistribution(numbers=[(GolfBall, -1)])", "how many GolfBall must be a whole number from 0"),
        ("LevelDistribution(numbers=[(GolfBall(), 1)])", "cannot stand here"),
        ("LevelDistribution(numbers={[]: 1})", "unhashable"),
        (HEAD.format("UniformNoise(2, 1)"), "line 3: UniformNoise: its range must go from low to high"),
        (HEAD.format("UniformNoise(2)"), "line 3: .*missing 1 required"),
        (HEAD.format("UniformNoise(*[1, 2])"), "line 3: .*cannot stand here"),
        (HEAD.format("GaussianNoise(mean=0, std='x')"), "line 3: GaussianNoise: std must be"),
        (HEAD.format("__import__('os').getcwd()"), "cannot stand here"),
        (HEAD.format("__import__('os')"), "there is no '__import__' here"),
        (HEAD.format("open('x', 'w')"), "there is no 'open' here"),
        (HEAD.format("[x for x in (1, 2)]"), "cannot stand here"),
        (HEAD.format("(lambda: 1)()"), "cannot stand here"),
        (HEAD.format("Mass.__subclasses__()"), "cannot stand here"),
        (HEAD.format("9**9**9"), "cannot stand here"),
        (HEAD.format("-" * 30_000 + "1"), "nested too deeply"),
        (HEAD.format("(" * 3000 + "1" + ")" * 3000), "nest"),
        ("#" * 100_001, "at most 100,000 characters"),
    ],
)
def test_a_text_that_is_no_distribution_is_refused_where_it_is_wrong(text: str, why: str) -> None:
    with pytest.raises(segar.SegarError, match=why):
        read_distribution(text, segar.family("empty-hard"))
