"""Mutated levels: one of the distribution's draws is another one, and all stays possible."""

import dataclasses

import numpy as np
import pytest
import scipy.stats

import segar
from segar.errors import LevelError
from segar.language import Mass, Order, Position, Square
from segar.levels import Levels, check_levels, mutate
from segar.rules import templates

N = 30


def rules_and_parameters() -> segar.LevelDistribution:
    """Levels that draw gravity, shapes, how many tiles there are, a factor that depends on another, and rules."""
    return segar.LevelDistribution(
        numbers=[(segar.GolfBall, 1), (segar.GoalTile, 1), (segar.SandTile, segar.noise.Choice([0, 1, 2]))],
        priors=[
            segar.Prior(Position, segar.RandomUniformLocation()),
            segar.Prior(Mass, segar.UniformNoise(0.5, 2.0)),
            segar.Prior(segar.Shape, segar.noise.Choice([segar.Circle(0.2), Square(0.3)]), segar.SandTile),
        ],
        parameters={segar.Gravity: segar.UniformNoise(1.0, 2.0)},
    ).with_rules(templates.dynamics_space())


def changed_arrays(before: Levels, after: Levels) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Which sampled values, parameters and types differ."""
    values = (before.sampled_values != after.sampled_values) & ~(
        np.isnan(before.sampled_values) & np.isnan(after.sampled_values)
    )
    return values, before.parameters != after.parameters, before.types != after.types


SOME = ("empty-easy", "empty-hard", "objectsx1-medium", "objectsx3-hard", "tilesx2-easy", "hazardtilesx3-hard")


@pytest.mark.parametrize("name", [*SOME, "rules"])
def test_mutated_levels_can_be_drawn_and_differ(name):
    dist = rules_and_parameters() if name == "rules" else segar.family(name)
    levels = dist.sample(N, seed=0)
    mutated = mutate(levels, np.random.default_rng(0))
    for one in (mutated, mutate(mutated, np.random.default_rng(1))):
        check_levels(one)
        assert np.isfinite(dist.log_prob(one, normalised=False)).all()
    differs = [part.reshape(N, -1).any(axis=1) for part in changed_arrays(levels, mutated)]
    outlines = [(levels.vertices != mutated.vertices).reshape(N, -1).any(axis=1),
                (levels.shape_kind != mutated.shape_kind).any(axis=1)]  # fmt: skip
    assert np.any([*differs, *outlines], axis=0).all()
    assert mutated.provenance.distribution == "" and mutated.distribution is dist


def test_one_change_changes_one_factor_of_one_entity_and_nothing_else():
    levels = segar.family("objectsx3-hard").sample(300, seed=0)
    mutated = mutate(levels, np.random.default_rng(1))
    values, parameters, types = changed_arrays(levels, mutated)
    layout = levels.layout
    owner = np.full(layout.width, -1)
    for number, (factor, first) in enumerate(layout.columns.items()):
        owner[first : first + factor.width] = number
    for level in range(len(levels)):
        slots, columns = np.nonzero(values[level, :-1])  # behind them stands the floor, whose friction is a parameter
        if types[level].any():
            assert types[level].sum() == 1 and set(slots) <= set(np.flatnonzero(types[level]))
        else:
            assert len({(slot, owner[column]) for slot, column in zip(slots, columns, strict=True)}) <= 1
        assert len(set(slots)) + parameters[level].sum() <= 1
    kept = ~types.any(axis=1)
    order = layout.columns[Order]
    np.testing.assert_array_equal(levels.values[kept][:, :, order], mutated.values[kept][:, :, order])


def test_a_factor_that_is_drawn_anew_has_its_prior():
    dist = segar.LevelDistribution(
        numbers=[(segar.GolfBall, 1)],
        priors=[segar.Prior(Position, [0.0, 0.0]), segar.Prior(Mass, segar.UniformNoise(1.0, 3.0))],
    )
    levels = dist.sample(2000, seed=0)
    narrow = levels[levels.values[:, 0, levels.layout.columns[Mass]] < 1.2]  # which the prior is not
    mass = mutate(narrow, np.random.default_rng(0)).values[:, 0, levels.layout.columns[Mass]]
    assert scipy.stats.kstest((mass - 1) / 2, "uniform").pvalue > 1e-3


def test_what_the_thing_in_a_slot_has_no_factor_of_is_no_change():
    levels = segar.family("puttputt-random-middle").sample(300, seed=3)
    mutated = mutate(levels, np.random.default_rng(1))
    differs = [part.reshape(300, -1).any(axis=1) for part in changed_arrays(levels, mutated)]
    assert np.any([*differs, (levels.vertices != mutated.vertices).any(axis=(1, 2, 3))], axis=0).all()


def test_equal_generators_mutate_equally():
    levels = segar.family("tilesx3-hard").sample(10, seed=0)
    assert mutate(levels, np.random.default_rng(4), 2) == mutate(levels, np.random.default_rng(4), 2)


def test_levels_from_an_index_on_are_those_of_a_larger_set():
    dist = segar.family("objectsx3-hard")
    assert dist.sample(5, seed=2, split="test", start=7) == dist.sample(12, seed=2, split="test")[7:]


@pytest.mark.parametrize("start", [-1, 0.5, True, 2**63])
def test_a_start_that_is_no_index_is_said(start):
    with pytest.raises(LevelError, match="the start must be the index of a level"):
        segar.family("empty-easy").sample(1, start=start)


def test_levels_that_cannot_be_mutated_say_why():
    levels = segar.family("empty-easy").sample(2, seed=0)
    with pytest.raises(LevelError, match="know no distribution"):
        mutate(dataclasses.replace(levels, distribution=None), np.random.default_rng(0))
    with pytest.raises(LevelError, match="changes must be a whole number above 0"):
        mutate(levels, np.random.default_rng(0), 0)
    with pytest.raises(segar.SegarError, match="mutate: rng must be a generator"):
        mutate(levels, 0)  # type: ignore
    fixed = segar.LevelDistribution(
        numbers=[(segar.GolfBall, 1)],
        priors=[segar.Prior(Position, [0.0, 0.0]), segar.Prior(Mass, segar.noise.Choice([2.0]))],
    )
    with pytest.raises(LevelError, match=r"\d+ tries to change"):
        mutate(fixed.sample(1), np.random.default_rng(0))
