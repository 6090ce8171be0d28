"""Rules that compute a number which is not finite are told in the step in which they do."""

import dataclasses

import numpy as np
import pytest

import segar
from segar import Charge, Differential, GoalTile, GolfBall, Mass, Position, RuleError, SetFactor, Velocity
from segar.envs import VectorEnv

STILL = np.zeros((4, 2), np.float32)


@segar.rule
def divide(m: Mass, q: Charge) -> SetFactor[Mass]:
    """The mass becomes infinite where the charge is 0."""
    return SetFactor[Mass](m, m / q)


@segar.rule
def fling(v: Velocity, q: Charge) -> Differential[Velocity]:
    return Differential[Velocity](v, (1.0 / q, 0.0))


def levels_of(*charges, rules):
    """One level for each charge of the ball, and a goal far from it."""
    goal = GoalTile({Position: (0.8, 0.8)})
    world = segar.World(rules=[segar.move, *rules])
    return segar.Levels.from_entities([[GolfBall({Charge: q}), goal] for q in charges], world=world)


def environments(levels, chosen=(0, 1, 0, 1), **options):
    env = VectorEnv(levels, 4, seed=0, **options)
    env.reset(options={"levels": np.array(chosen)})
    return env


@pytest.mark.parametrize("rule, factor, value", [(divide, "Mass", "inf"), (fling, "Velocity", "nan")])
def test_the_first_environment_with_its_entity_factor_and_rule_is_named(rule, factor, value):
    env = environments(levels_of(1.0, 0.0, rules=[rule]))
    with pytest.raises(RuleError) as caught:
        env.step(STILL)
    said = str(caught.value)
    assert said.startswith(f"environment 1, level 1: after this step, {factor} of 'golfball' is {value}"), said
    assert f"(changed by {rule.where})" in said and "The same holds for 1 other environments" in said


def test_a_rule_that_was_made_without_a_module_is_named_too():
    names = {"SetFactor": SetFactor, "Mass": Mass, "Charge": Charge, "__name__": None}
    exec("def made(m: Mass, q: Charge) -> SetFactor[Mass]:\n    return SetFactor[Mass](m, m / q)", names)
    assert names["made"].__module__ is None
    env = environments(levels_of(1.0, 0.0, rules=[names["made"]]))
    with pytest.raises(RuleError, match=r"Mass of 'golfball' is inf \(changed by made"):
        env.step(STILL)


@pytest.mark.slow
def test_a_step_that_went_wrong_is_told_again_until_the_environment_starts_anew():
    env = environments(levels_of(1.0, 0.0, rules=[divide]))
    for _ in range(2):
        with pytest.raises(RuleError, match="environment 1, level 1: "):
            env.step(STILL)
    env.reset(options={"levels": np.zeros(4, int)})
    assert np.isfinite(env.step(STILL)[1]).all()


def test_an_entity_that_is_absent_is_no_reason_to_complain():
    ball, goal = GolfBall({Charge: 1.0}), GoalTile({Position: (0.8, 0.8)})
    world = segar.World(rules=[segar.move, divide])
    more = [segar.Ball({Position: (-0.5, -0.5), Charge: q}) for q in (2.0, 0.0)]
    levels = segar.Levels.from_entities([[ball, goal], *([ball, goal, one] for one in more)], world=world)
    env = environments(levels)
    for _ in range(5):
        env.step(STILL)
    env.reset(options={"levels": np.array([0, 2, 0, 0])})
    with pytest.raises(RuleError, match="environment 1, level 2: after this step, Mass of 'ball' is inf"):
        env.step(STILL)


def test_a_reward_that_is_not_finite_is_told_although_the_state_is():
    def odd_reward(ball: GolfBall) -> float:
        return 1.0 / ball[Charge]

    task = dataclasses.replace(segar.puttputt(), reward=odd_reward)
    env = environments(levels_of(1.0, 0.0, rules=[]), task=task)
    with pytest.raises(RuleError, match=r"environment 1, level 1: the reward of this step is inf \(.*odd_reward"):
        env.step(STILL)


def test_a_conflict_is_told_before_numbers_that_are_not_finite():
    def divide_or(value):
        def divided(m: Mass, q: Charge) -> SetFactor[Mass]:
            return SetFactor[Mass](m, 1.0 / q) if q < 5 else SetFactor[Mass](m, value)

        return segar.rule(divided)

    env = environments(levels_of(0.0, 9.0, rules=[divide_or(2.0), divide_or(3.0)]))
    with pytest.raises(segar.ConflictError, match="environment 1: "):
        env.step(STILL)


def test_interventions_and_snapshots_with_numbers_that_are_not_finite_are_refused():
    env = environments(levels_of(1.0, 1.0, rules=[]))
    snapshot = env.state()
    snapshot.state.values[2, 0, env.levels.layout.columns[Mass]] = np.inf
    with pytest.raises(segar.SegarError, match="environment 2 has numbers that are not finite: Mass of 'golfball'"):
        env.restore(snapshot)
