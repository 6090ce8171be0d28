"""Many bodies: sorting them, listing near pairs and passing over quiet partners change the cost and nothing else."""

from typing import Tuple

import numpy as np
import pytest

from segar import DEFAULT_RULES, Ball, GoalTile, GolfBall, Levels, Mass, Mobile, Position, Size, Velocity, World
from segar.engine.compiler import kernel
from segar.engine.compiler.kernel import MANY_BODIES
from segar.engine.compiler.sparse_pairs import MANY_PARTNERS
from segar.engine.simulator import State
from segar.language import Acceleration, Aggregate, Charge, Differential, SetFactor, StoredEnergy
from segar.language import VectorValue as Vector
from tests.segar.engine.test_contacts import OVERLAP, depths
from tests.segar.engine.worlds import compare, read, start, uncompiled

BODIES = MANY_BODIES + 6


def crowd(count: int, rng: np.random.Generator, size: float = 0.2, speed: float = 1.0, levels: int = 3) -> Levels:
    """Balls anywhere in the arena, some of them charged and some of them fixed."""
    made = []
    for _ in range(levels):
        balls = [
            Ball({
                Position: rng.uniform(-0.9, 0.9, 2),
                Velocity: rng.normal(0, speed, 2),
                Size: size * rng.uniform(0.5, 1.0),
                Charge: float(rng.choice([0.0, 0.0, 0.0, 1.0])),
                Mobile: bool(rng.random() < 0.9),
                StoredEnergy: float(rng.choice([0.0, 0.0, 0.5])),
            })
            for _ in range(count)
        ]  # fmt: skip
        made.append([GolfBall({Position: [0.0, -0.5]}), GoalTile({Position: [0.0, 0.8]}), *balls])
    return Levels.from_entities(made)


@pytest.mark.parametrize("speed", [1.0, *(pytest.param(speed, marks=pytest.mark.slow) for speed in (0.0, 30.0))])
def test_kernel_and_interpreter_agree_on_crowds(speed):
    levels = crowd(BODIES, np.random.default_rng(1), speed=speed, levels=2)
    simulator = uncompiled(World(), levels.layout)
    state = start(levels)
    for _ in range(3):
        found = compare(simulator, levels, state)
        assert found.worst <= 1e-12 and found.worst_crowded <= 1e-6, found
        simulator.step(state, levels)
    assert state.contacts.min() > 0


def test_sorted_bodies_meet_as_unsorted_ones_do(monkeypatch):
    """The same crowd with the sweep and with all pairs compared: equal to the bit."""
    levels, ends = crowd(BODIES, np.random.default_rng(2)), []
    monkeypatch.setattr(kernel, "_written", kernel._written.__wrapped__)
    for many in (MANY_BODIES, 1000):
        monkeypatch.setattr(kernel, "MANY_BODIES", many)
        simulator, state = uncompiled(World(), levels.layout), start(levels)
        simulator.step(state, levels, 8)
        ends.append(state)
    assert ends[0].contacts.sum() > 20 and np.array_equal(ends[0].contacts, ends[1].contacts)
    assert ends[0].values.tobytes() == ends[1].values.tobytes()


def breeze(fan: Tuple[Charge, StoredEnergy], body: Tuple[Mass, Acceleration]) -> Aggregate[Acceleration]:
    """A quiet partner adds something, the same for all of them; one with charge speaks for itself."""
    (charge, energy), (mass, a) = fan, body
    if charge == 0 and energy == 0:
        return Aggregate[Acceleration](a, Vector(0.1, -0.2) / mass)
    return Aggregate[Acceleration](a, Vector(charge, energy) * mass)


def drift(fan: Tuple[Charge], body: Tuple[Mass]) -> Differential[Mass]:
    (charge,), (mass,) = fan, body
    if not charge:
        return Differential[Mass](mass, 0.25)
    return None


def label(fan: Tuple[Charge], body: Tuple[StoredEnergy]) -> SetFactor[StoredEnergy]:
    (charge,), (energy,) = fan, body
    if not charge:
        return SetFactor[StoredEnergy](energy, 0.125)
    return None


@pytest.mark.parametrize("rules", [(breeze,), (drift,), (label,), (*DEFAULT_RULES, breeze, drift)], ids=len)
def test_quiet_partners_count_as_often_as_they_are_there(rules):
    for count in (MANY_PARTNERS, 7):
        levels = crowd(count, np.random.default_rng(count))
        simulator = uncompiled(World(rules), levels.layout)
        state = start(levels)
        for _ in range(2):
            found = compare(simulator, levels, state)
            assert found.worst <= 1e-12, found
            simulator.step(state, levels)


def pair_at_rest(distance: float, first_mobile: bool = True, second_mobile: bool = True) -> tuple[Levels, State]:
    """Two balls, and their state after a sub-step."""
    balls = [
        Ball({Position: [x, 0.0], Size: 0.2, Mobile: mobile})
        for x, mobile in ((0.0, first_mobile), (distance, second_mobile))
    ]
    levels = Levels.from_entities([[GolfBall({Position: [0, -0.9]}), GoalTile({Position: [0.5, 0.8]}), *balls]])
    state = start(levels)
    uncompiled(World(), levels.layout).step(state, levels)
    return levels, state


@pytest.mark.parametrize("distance", [0.0, 0.05, 0.199])
def test_what_overlaps_at_rest_is_pushed_apart(distance):
    levels, state = pair_at_rest(distance)
    assert depths(state, levels)[0][0] < OVERLAP and state.unresolved_contacts[0] == 0
    x = read(state, levels, Position)[0, 2:4]
    np.testing.assert_allclose(x.sum(axis=0), [distance, 0.0], atol=1e-12)  # both go equally far
    assert not read(state, levels, Velocity)[0, 2:4].any()


def test_only_what_is_mobile_is_pushed():
    levels, state = pair_at_rest(0.1, first_mobile=False)
    x = read(state, levels, Position)[0, 2:4, 0]
    assert x[0] == 0.0 and 0.2 <= x[1] < 0.2 + OVERLAP


def test_fixed_bodies_that_overlap_stay_and_cost_nothing():
    levels, state = pair_at_rest(0.1, first_mobile=False, second_mobile=False)
    np.testing.assert_array_equal(read(state, levels, Position)[0, 2:4, 0], [0.0, 0.1])
    assert state.contacts[0] == 0 and state.unresolved_contacts[0] == 0
