"""Functions of a task over many entities: sums and any, best and every, and several functions in one place."""

import numpy as np
import pytest

from segar import Ball, LevelDistribution, Mass, Object, Position, Prior, RuleError, SetFactor, Task, Velocity, World
from segar.engine import StepResult
from segar.language import Action, Best, Done, Every, FloorFriction, Hole, StoredEnergy, rule, value_rule
from segar.noise import DiscreteRangeNoise, RandomUniformLocation
from tests.segar.engine.worlds import compare, random_states, read, uncompiled

SOME = LevelDistribution(
    numbers=[(Ball, DiscreteRangeNoise(0, 3)), (Hole, DiscreteRangeNoise(0, 2)), (Object, 1)],
    priors=[Prior(Position, RandomUniformLocation())],
    min_distance=0.0,
).sample(60, seed=0)
NOTHING = World(rules=(), wall_contact=None, pair_contact=None, solid=None)


def push(body: Object, action: Action) -> SetFactor[Velocity]:
    return SetFactor[Velocity](body[Velocity], body[Velocity] + action[0])


def gain(ball: Ball) -> SetFactor[StoredEnergy]:
    return SetFactor[StoredEnergy](ball[StoredEnergy], ball[Mass])


def nearness(ball: Ball, hole: Best[Hole]) -> float:
    return -(ball[Position] - hole[Position]).norm()


def fee(body: Object, action: Action) -> float:
    return -body[Mass] * action[0]


def all_done(body: Object, ball: Every[Ball]) -> bool:
    return body[Mass] > 1 and ball[Done]


TASK = Task("several", (push, gain), (nearness, fee), all_done, action_low=(0.0,), action_high=(1.0,), sub_steps=1)


@pytest.fixture(scope="module")
def played():
    """The simulator, the states before and after a step, its outcome, and the actions."""
    state = random_states(SOME, 300, np.random.default_rng(0), speed=0.1)
    read(state, SOME, Done)[::3] = 1.0
    outcome = StepResult.empty(300)
    actions = np.full((300, 1), 0.5, np.float32)
    before = state.copy()
    simulator = uncompiled(NOTHING, SOME.layout, TASK)
    simulator.act(state, SOME, actions, outcome)
    return simulator, before, state, outcome, actions


def present(state, slot_type: type) -> np.ndarray:
    types = SOME.types[state.level]
    kinds = [i for i, t in enumerate(SOME.layout.types) if issubclass(t, slot_type)]
    return np.isin(types, kinds)


def test_the_best_value_counts_and_the_terms_of_a_reward_add_up(played):
    _, _, state, outcome, _ = played
    x = read(state, SOME, Position)
    ball, hole, body = (present(state, kind) for kind in (Ball, Hole, Object))
    distance = np.linalg.norm(x[:, :, None] - x[:, None], axis=-1)
    nearest = np.where(hole[:, None], distance, np.inf).min(axis=2)
    counted = np.logical_and(ball, hole.any(axis=1, keepdims=True))
    expected = -np.where(counted, nearest, 0).sum(axis=1)
    expected -= 0.5 * np.where(body, read(state, SOME, Mass), 0).sum(axis=1)
    np.testing.assert_allclose(outcome.reward, expected, rtol=1e-12)
    assert 0 < counted.any(axis=1).mean() < 1


def test_every_one_must_hold_and_there_must_be_one(played):
    _, _, state, outcome, _ = played
    ball, body = present(state, Ball), present(state, Object)
    done, heavy = read(state, SOME, Done) == 1, read(state, SOME, Mass) > 1
    others = ball[:, None] & ~np.eye(ball.shape[1], dtype=bool)  # beside each body
    holds = others.any(axis=2) & (done[:, None] | ~others).all(axis=2)
    expected = (body & heavy & holds).any(axis=1)
    assert np.array_equal(outcome.terminated, expected) and 0 < expected.mean() < 1


def test_each_rule_of_an_action_acts_on_what_it_matches(played):
    _, before, state, _, _ = played
    ball = present(state, Ball)
    assert np.array_equal(read(state, SOME, StoredEnergy)[ball], read(before, SOME, Mass)[ball])
    moved = read(state, SOME, Velocity) - read(before, SOME, Velocity)
    away_from_walls = (np.abs(read(before, SOME, Position)) < 0.8).all(axis=-1)
    np.testing.assert_allclose(moved[present(state, Object) & away_from_walls], 0.5, atol=1e-12)


def test_the_interpreter_agrees(played):
    simulator, before, _, _, actions = played
    assert compare(simulator, SOME, before, actions).worst < 1e-12


def test_hints_that_mean_nothing_are_refused():
    def rule_with_best(ball: Ball, hole: Best[Hole]) -> SetFactor[Mass]: ...
    def every_number(ball: Every[Ball]) -> float: ...
    def best_first(hole: Best[Hole], ball: Ball) -> float: ...
    def best_mass(mass: Best[Mass]) -> float: ...

    with pytest.raises(RuleError, match="argument 'hole': only a task's reward can ask for Best"):
        rule(rule_with_best)
    with pytest.raises(RuleError, match="argument 'ball': only a task's terminated, success and death can ask for"):
        value_rule(every_number, truth=False)
    with pytest.raises(RuleError, match=r"argument 'ball': arguments with Best\[...\] come last"):
        value_rule(best_first, truth=False)
    with pytest.raises(RuleError, match=r"argument 'mass': Best\[...\] takes an entity class or a Tuple of factors"):
        value_rule(best_mass, truth=False)


def test_a_task_for_other_entities_is_refused_with_the_fix():
    alone = LevelDistribution(numbers=[(Object, 1)], parameters={FloorFriction: 0.1}).sample(1)
    with pytest.raises(RuleError, match=r"the task needs Ball and Hole, but the levels have only .*; choose the task"):
        uncompiled(NOTHING, alone.layout, TASK)
