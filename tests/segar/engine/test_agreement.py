"""Kernels and the interpreter are two implementations of one semantics: they must agree to rounding."""

from dataclasses import replace
from unittest import mock

import numpy as np
import pytest
from hypothesis import HealthCheck, assume, given, settings
from hypothesis import strategies as st

import segar.language.random
from segar import DEFAULT_RULES, Action, Charge, ConflictError, Gravity, Mass, Object, RuleError, Task, Velocity, World
from segar.engine.simulator import Simulator, State, StepResult
from segar.language import Alive, Differential, GoalTile, GolfBall, Position, SetFactor, overlaps
from segar.language import VectorValue as Vector
from tests.segar.engine.random_rules import Author, mixed_levels
from tests.segar.engine.test_mathematics_in_rules import LEVELS as EMPTY
from tests.segar.engine.test_mathematics_in_rules import mix
from tests.segar.engine.worlds import Disagreement, compare, random_states, start, uncompiled

MIXED = mixed_levels(np.random.default_rng(0))


def accept(found: Disagreement, worst: float = 1e-12) -> None:
    assert found.worst <= worst and found.worst_crowded <= 1e-6, found


@pytest.mark.parametrize("name", ["empty-hard", "objectsx3-hard", "tilesx3-hard"])
def test_kernel_and_interpreter_agree_on_steps_from_random_states(sampled, name):
    simulator, levels = sampled(name)
    rng = np.random.default_rng(1)
    state = random_states(levels, 25, rng)
    found = compare(simulator, levels, state, rng.uniform(-1.5, 1.5, (25, 2)).astype(np.float32))
    accept(found)
    assert found.contacts > 0


def test_kernel_and_interpreter_agree_in_dense_crowds_of_fast_bodies(sampled):
    simulator, levels = sampled("objectsx3-hard")
    rng = np.random.default_rng(2)
    state = random_states(levels, 40, rng, speed=5.0)
    state.values[:, :, :2] *= 0.3
    found = compare(simulator, levels, state)
    accept(found)
    assert found.contacts > 40


@pytest.mark.parametrize("name", ["objectsx3-hard", "tilesx3-hard"])
def test_kernel_and_interpreter_agree_over_six_steps_from_the_start(sampled, name):
    simulator, levels = sampled(name)
    state, rng = start(levels[:3]), np.random.default_rng(3)
    for _ in range(6):
        actions = rng.uniform(-1, 1, (3, 2)).astype(np.float32)
        accept(compare(simulator, levels, state, actions))
        simulator.act(state, levels, actions, StepResult.empty(3))


@pytest.mark.slow
def test_compiled_random_rules_agree_on_mixed_and_optional_slots(mixed):
    simulator, levels = mixed
    rng = np.random.default_rng(4)
    state = random_states(levels, 40, rng)
    accept(compare(simulator, levels, state, rng.uniform(-1, 1, (40, 2)).astype(np.float32)))


@mock.patch("segar.engine.compiler.running_kernel.LONG_STEP", np.inf)
@settings(max_examples=25, deadline=None, derandomize=True, suppress_health_check=list(HealthCheck))
@given(seed=st.integers(0, 2**32 - 1), defaults=st.booleans())
def test_worlds_of_random_rules_agree(seed, defaults):
    rng = np.random.default_rng(seed)
    author = Author(rng)
    try:
        rules = [author.rule() for _ in range(rng.integers(1, 5))] + list(DEFAULT_RULES if defaults else ())
        simulator = uncompiled(World([rules[i] for i in rng.permutation(len(rules))]), MIXED.layout)
    except (RuleError, ConflictError) as error:
        assert "paths" in str(error) or "always set" in str(error), error
        assume(False)
    accept(compare(simulator, MIXED, random_states(MIXED, 4, rng), n=2))


def noisy_task() -> Task:
    """A task that uses what tasks may use: random actions, an action in the reward, relations, draws, all objects."""

    def jolt(body: Object, action: Action, g: Gravity) -> tuple[SetFactor[Velocity], Differential[Charge]]:
        kick = Vector(segar.random.normal(action[1], 0.1), action[0]) / g
        return SetFactor[Velocity](body[Velocity], body[Velocity] + kick), Differential[Charge](body[Charge], action[2])

    def reward(body: Object, other: Object, action: Action) -> float:
        apart = (body[Position] - other[Position]).norm()
        return apart * segar.random.uniform() - action[2] ** 2 if body[Alive] else segar.random.uniform(-2, -1)

    def over(ball: GolfBall, goal: GoalTile) -> bool:
        return overlaps.function(ball, goal) and ball[Mass] > 0.5

    def lucky(ball: GolfBall) -> bool:
        return segar.random.bernoulli(0.5)

    low, high = (-1.0, -2.0, 0.0), (1.0, 2.0, 0.5)
    return Task("noisy", jolt, reward, over, lucky, lucky, action_low=low, action_high=high, sub_steps=3)


def test_every_part_of_a_task_agrees():
    rng = np.random.default_rng(5)
    simulator = uncompiled(World(), MIXED.layout, noisy_task())
    accept(compare(simulator, MIXED, random_states(MIXED, 20, rng), rng.normal(0, 1, (20, 3)).astype(np.float32)))


@pytest.mark.parametrize("part", ["limit", "wall_contact", "pair_contact", "solid"])
def test_worlds_without_a_contact_rule_agree(part):
    simulator = uncompiled(World(**{part: None}), MIXED.layout)
    accept(compare(simulator, MIXED, random_states(MIXED, 15, np.random.default_rng(6), speed=3.0)))


@pytest.mark.parametrize("name", ["objectsx3-hard", "drawn"])
def test_a_step_depends_on_nothing_but_the_state_its_level_and_its_key(sampled, name, eager_threads):
    """Batch size, place in the batch and number of threads change no bit, of rules that draw numbers neither."""
    simulator, levels = (Simulator(World((mix,)), EMPTY.layout), EMPTY) if name == "drawn" else sampled(name)
    whole = random_states(levels, 64, np.random.default_rng(7))
    turned = State(**{name: array[::-1].copy() for name, array in vars(whole).items()})
    one = State(**{name: array[5:6].copy() for name, array in vars(whole).items()})
    simulator.step(whole, levels, 5)
    replace(simulator, num_threads=2).step(turned, levels, 5)
    simulator.step(one, levels, 5)
    assert np.array_equal(whole.values, turned.values[::-1], equal_nan=True)
    assert np.array_equal(whole.values[5], one.values[0], equal_nan=True)
