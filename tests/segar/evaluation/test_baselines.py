"""Baselines: the players between which scores are normalised, and the right order of their returns."""

import dataclasses

import numpy as np
import pytest

import segar
from segar.errors import SegarError
from segar.evaluation import Baselines, Idle, Random, RecordedActions, Scripted, find_baselines, play_episodes
from segar.hardness import plan

LEVELS = segar.family("empty-hard").sample(12, seed=0)
TWICE = np.tile(np.arange(12), 2)


def mean_return(policy):
    found = play_episodes(LEVELS, TWICE, policy, seed=0)
    assert found.level.tolist() == TWICE.tolist()
    return found.returns.mean(), found.success.mean()


def test_the_oracle_plays_its_plan_and_beats_the_script_which_beats_chance():
    found = plan(LEVELS, rng=np.random.default_rng(0), samples=32, iterations=3)
    oracle, solved = mean_return(RecordedActions(found.actions))
    assert solved == 1.0
    assert oracle == pytest.approx(found.returns.mean(), rel=1e-6)
    assert oracle >= mean_return(Scripted())[0] > mean_return(Random(0))[0]


@pytest.mark.parametrize("unit_actions", [False, True])
def test_a_random_player_acts_uniformly_and_repeats_itself_with_the_same_seeds(unit_actions):
    task = dataclasses.replace(segar.puttputt(), action_low=(-2.0, -2.0), action_high=(2.0, 2.0))
    env = segar.envs.VectorEnv(LEVELS, 5000, seed=0, task=task, unit_actions=unit_actions)
    one, other = Random(3), Random(3)
    one.begin(env)
    other.begin(env)
    actions = one(None)
    assert actions.shape == (5000, 2) and actions.dtype == np.float32
    for share in np.histogram(actions, 4, (env.action_space.low.min(), env.action_space.high.max()))[0] / actions.size:
        assert share == pytest.approx(0.25, abs=0.02)
    np.testing.assert_array_equal(other(None), actions)
    one.begin(env)
    assert not np.array_equal(one(None), actions)


def test_an_idle_player_does_not_move():
    policy = Idle()
    env = segar.envs.VectorEnv(LEVELS, 4, seed=0)
    policy.begin(env)
    before, _ = env.reset()
    after, *_ = env.step(policy(before))
    np.testing.assert_array_equal(before, after)


@pytest.fixture(scope="module")
def baselines():
    return find_baselines(LEVELS, rng=np.random.default_rng(0), plays=50, samples=32, iterations=3)


def test_the_better_of_idle_and_random_play_scores_0_and_the_planner_1(baselines):
    assert baselines.normalised(baselines.floor.mean()) == 0.0
    assert baselines.normalised(baselines.oracle.mean()) == 1.0
    assert baselines.regret(baselines.oracle.mean()) == 0.0
    script, _ = mean_return(Scripted())
    assert 0.9 < baselines.normalised(script) <= 1.0


def test_the_baselines_are_what_the_players_reach_in_evaluation(baselines):
    assert baselines.idle.tolist() == play_episodes(LEVELS, np.arange(12), Idle(), seed=0).returns.tolist()
    by_evaluation, _ = mean_return(Random(0))
    scale = baselines.oracle.mean() - baselines.random.mean()
    assert (by_evaluation - baselines.random.mean()) / scale == pytest.approx(0.0, abs=0.15)


def test_neither_standing_still_nor_acting_at_random_scores_above_0(baselines):
    assert (baselines.floor >= baselines.idle).all() and (baselines.floor >= baselines.random).all()
    assert baselines.floor.mean() >= max(baselines.idle.mean(), baselines.random.mean())
    assert baselines.normalised(baselines.idle.mean()) <= 0 and baselines.normalised(baselines.random.mean()) <= 0
    # Each is better on some of these levels, so the floor is above the better of both means.
    assert baselines.normalised(max(baselines.idle.mean(), baselines.random.mean())) < 0


def test_scores_and_regrets_are_linear_and_nan_where_nothing_can_be_won():
    ends = Baselines(random=np.array([-10.0, -14.0]), idle=np.array([-12.0, -10.0]), oracle=np.array([-1.5, -0.5]))
    np.testing.assert_allclose(ends.normalised([-10.0, -5.5, -1.0, -19.0]), [0.0, 0.5, 1.0, -1.0])
    np.testing.assert_allclose(ends.regret([-10.0, -1.0, 0.0]), [9.0, 0.0, -1.0])
    a, b, share = -7.0, -2.0, 0.3
    for scale in (ends.normalised, ends.regret):
        assert scale(share * a + (1 - share) * b) == pytest.approx(share * scale(a) + (1 - share) * scale(b))
    same = np.array([-2.0])
    for oracle in (same, same + 4e-16):
        assert np.isnan(Baselines(random=same, idle=same - 1, oracle=oracle).normalised(-3.0))


@segar.rule
def gusts(a: segar.Acceleration) -> segar.Aggregate[segar.Acceleration]:
    """Chance in the rules, which also moves who does nothing."""
    return segar.Aggregate[segar.Acceleration](a, (segar.random.normal(0.0, 5.0), segar.random.normal(0.0, 5.0)))


def test_where_rules_have_chance_the_idle_player_meets_the_draws_of_the_seed():
    levels = segar.family("empty-hard").with_rules([*segar.DEFAULT_RULES, gusts]).sample(3, seed=0)
    idle = play_episodes(levels, np.arange(3), Idle(), seed=7).returns.tolist()
    search = {"plays": 1, "samples": 8, "iterations": 1}
    same, other = (find_baselines(levels, rng=np.random.default_rng(0), seed=seed, **search).idle for seed in (7, 8))
    assert same.tolist() == idle and not np.array_equal(same, other)


def test_a_script_refuses_a_task_that_has_none():
    task = dataclasses.replace(segar.puttputt(), demo_actions=None)
    with pytest.raises(SegarError, match="task puttputt-squared has no scripted player"):
        play_episodes(LEVELS, np.arange(2), Scripted(), seed=0, task=task)
