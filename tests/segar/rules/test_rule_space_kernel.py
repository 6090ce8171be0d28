"""One kernel for all rule sets of a space: it agrees with the interpreter, and to the bit with the world of each rule set."""

import dataclasses

import numpy as np
import pytest

import segar
from segar import Charge, DiscreteRangeNoise, Levels, Magnetism, Mass, World, family
from segar.engine import Simulator
from segar.levels import active_options, rule_space_of
from segar.rules.templates import dynamics_space
from tests.segar.engine.worlds import compare, random_states, start, uncompiled

SPACE = dynamics_space()


def specialised(levels: Levels) -> Levels:
    """One level in a world that has its rules alone."""
    space = rule_space_of(levels)
    names = [name for name, is_active in zip(space.names, active_options(levels)[0], strict=True) if is_active]
    chosen = [space.options[k] for k in sorted(map(space.index, names))]
    rules = (*space.always, *(rule for option in chosen for rule in option.rules))
    notes = [rule for option in chosen for rule in option.on_contact]
    return dataclasses.replace(levels, world=World(rules, on_contact=notes))


def charged(levels: Levels) -> Levels:
    """The levels with charges, magnetism and masses that are all different, so that every force has an effect."""
    values, rng = levels.values.copy(), np.random.default_rng(0)
    for factor in (Charge, Magnetism, Mass):
        column = levels.layout.columns[factor]
        part = values[:, :, column]
        part[:] = np.where(np.isnan(part), np.nan, rng.uniform(0.3, 1.5, part.shape))
    return dataclasses.replace(levels, values=values)


def ends(levels: Levels, make=Simulator, sub_steps: int = 25) -> np.ndarray:
    """The states of levels after some sub-steps from their start with random velocities."""
    simulator, state, rng = make(levels.world, levels.layout), start(levels), np.random.default_rng(1)
    column = levels.layout.columns[segar.Velocity]
    part = state.values[..., column : column + 2]
    part[:] = np.where(np.isnan(part), np.nan, rng.uniform(-2, 2, part.shape[1:]))
    state.key[:] = 7
    simulator.step(state, levels, sub_steps)
    return state.values


@pytest.mark.parametrize("name", ["objectsx1-hard", pytest.param("tilesx3-hard", marks=pytest.mark.slow)])
def test_kernel_and_interpreter_agree_on_random_rule_sets(name, request):
    count = 30 if name == "objectsx1-hard" else 1000
    levels = charged(family(name).with_rules(dynamics_space(DiscreteRangeNoise(0, 6))).sample(count, seed=2))
    state = random_states(levels, count, np.random.default_rng(3), speed=1.0)
    state.level[:] = np.arange(count)
    found = compare(Simulator(levels.world or World(), levels.layout), levels, state, n=2)
    assert found.worst <= 1e-12 and found.worst_crowded <= 1e-6, found
    assert found.contacts > 0


@pytest.mark.parametrize(
    ("name", "count", "make", "sub_steps"),
    [
        ("objectsx1-hard", 6, uncompiled, 25),
        pytest.param("tilesx2-hard", 12, Simulator, 200, marks=[pytest.mark.slow, pytest.mark.compiled]),
    ],
)
def test_a_rule_set_of_the_space_equals_the_world_of_its_rules_to_the_bit(name, count, make, sub_steps):
    levels = charged(family(name).with_rules(SPACE).sample(count, seed=11))
    together = ends(levels, make, sub_steps)
    for index in range(count):
        assert together[index].tobytes() == ends(specialised(levels[index]), make, sub_steps)[0].tobytes()


@pytest.mark.parametrize(
    "name",
    [
        "objectsx1-hard",
        pytest.param("tilesx3-hard", marks=pytest.mark.slow),
        pytest.param("empty-hard", marks=pytest.mark.slow),
    ],
)
def test_the_default_physics_is_a_point_of_the_space(name):
    """The options lorentz and friction together are the default rules, to the bit."""
    plain, levels = family(name).sample(5, seed=3), family(name).with_rules(SPACE).sample(5, seed=3)
    chosen = {SPACE.options[SPACE.index(option)].active: 1.0 for option in ("lorentz", "friction")}
    parameters = np.array([[chosen.get(p, p.default) for p in levels.layout.parameters]] * 5)
    known = [levels.layout.parameters.index(p) for p in plain.layout.parameters]
    parameters[:, known] = plain.parameters
    point = dataclasses.replace(levels, parameters=parameters)
    assert ends(dataclasses.replace(plain, world=World())).tobytes() == ends(point).tobytes()
