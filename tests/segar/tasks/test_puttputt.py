"""PuttPutt: its levels, its results, its scripted player."""

import dataclasses

import numpy as np
import pytest

import segar
from segar import Position, Velocity
from segar.envs import Env, VectorEnv
from segar.tasks.puttputt_task import demo_actions
from tests.segar.tasks.play import at_random, by_script, episodes

EMPTY = segar.family("empty-easy").sample(50, seed=0)
BALL, GOAL = 0, 1


def test_the_scripted_player_solves_empty_easy_far_more_often_than_random_play():
    env = VectorEnv(EMPTY, 100, seed=0)
    random, scripted = (episodes(env, policy)["success"] for policy in (at_random(), by_script(env)))
    assert scripted.mean() > 0.95 and random.mean() < 0.5


def test_the_scripted_player_pushes_straight_at_the_goal_and_within_the_range_of_actions():
    env = VectorEnv(EMPTY, 50, seed=0, autoreset_mode="Disabled")
    _, info = env.reset(options={"levels": np.arange(50)})
    push, x = demo_actions(env.factors), info["factors"]["Position"]
    assert push.shape == (50, 2) and push.dtype == np.float32 and np.abs(push).max() <= 1
    towards = x[:, GOAL] - x[:, BALL]
    cosine = (push * towards).sum(axis=1) / np.linalg.norm(push, axis=1) / np.linalg.norm(towards, axis=1)
    assert cosine.min() > 1 - 1e-6


@pytest.mark.slow
def test_a_weaker_push_is_used_more_of_by_the_scripted_player():
    env = VectorEnv(EMPTY, 50, task=segar.puttputt(impulse=0.5), seed=0)
    assert episodes(env, by_script(env))["success"].mean() > 0.9


def test_one_environment_can_be_played_by_script_too():
    env, terminated = Env(EMPTY, seed=0), False
    env.reset(seed=0)
    while not terminated:
        _, _, terminated, _, info = env.step(env.task.demo_actions(env.factors))
    results = env.task.results_of(env.factors)
    assert info["success"] and results["distance_to_goal"] <= 0.01
    assert results["alive"] is True and results["velocity"].shape == (2,)


def test_the_results_of_a_step_are_those_of_its_factors():
    env = VectorEnv(EMPTY, 8, seed=0, autoreset_mode="Disabled")
    env.reset(seed=0)
    _, reward, _, _, info = env.step(np.full((8, 2), 0.2, np.float32))
    results, factors = env.task.results_of(env.factors), info["factors"]
    assert set(results) == {"distance_to_goal", "velocity", "acceleration", "mass", "alive"}
    np.testing.assert_allclose(results["distance_to_goal"] ** 2, -reward, rtol=1e-12)
    assert np.array_equal(results["velocity"], factors["Velocity"][:, BALL]) and results["velocity"].shape == (8, 2)
    assert np.array_equal(results["mass"], factors["Mass"][:, BALL]) and results["alive"].dtype == bool


def test_final_results_are_about_the_episode_that_ended():
    env = VectorEnv(EMPTY, 16, seed=0, max_steps=3)
    env.reset(seed=0)
    for _ in range(3):
        _, reward, _, _, info = env.step(np.full((16, 2), 0.2, np.float32))
    assert info["_final_info"].all()
    final, now = (env.task.results_of(env.factors_of(one))["distance_to_goal"] for one in (info["final_info"], info))
    np.testing.assert_allclose(final**2, -reward, rtol=1e-12)
    x = info["factors"]["Position"]
    np.testing.assert_allclose(now, np.linalg.norm(x[:, BALL] - x[:, GOAL], axis=-1) / 8**0.5)
    assert not np.allclose(final, now)


def test_a_result_is_computed_only_when_it_is_asked_for():
    asked = []
    task = dataclasses.replace(segar.puttputt(), results={"counted": lambda factors: asked.append(1) or np.zeros(4)})
    env = VectorEnv(EMPTY, 4, task=task, seed=0, max_steps=2)
    env.reset(seed=0)
    for _ in range(4):
        info = env.step(np.zeros((4, 2), np.float32))[-1]
    assert not asked
    found = [task.results_of(factors)["counted"] for factors in (env.factors, env.factors_of(info["final_info"]))]
    assert len(asked) == len(found) == 2


@pytest.mark.slow
def test_with_a_goal_speed_a_fast_ball_rolls_over_the_goal():
    env = VectorEnv(EMPTY, 2, task=segar.puttputt(goal_speed=0.1, sub_steps=1), seed=0, autoreset_mode="Disabled")
    x = env.reset(options={"levels": np.zeros(2, int)})[1]["factors"]["Position"][0, GOAL]
    env.intervene("golfball", Position, tuple(x))
    env.intervene("golfball", Velocity, (0.5, 0.0), where=np.array([True, False]))
    _, _, terminated, _, info = env.step(np.zeros((2, 2), np.float32))
    assert terminated.tolist() == info["success"].tolist() == [False, True]
    assert (env.task.results_of(env.factors)["distance_to_goal"] <= 0.01).all()
