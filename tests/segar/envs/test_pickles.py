"""Environments, worlds, tasks, rules and distributions that were pickled behave as they did before."""

import copy
import dataclasses
import pickle
import threading
from typing import Any, Tuple

import cloudpickle
import gymnasium
import numpy as np
import pytest

import segar
from segar import GoalTile, GolfBall, Mass, Position, SegarError, SetFactor, Velocity
from segar.envs import Env, VectorEnv
from segar.language import Factors, is_equal
from segar.observations import Pixels, Stack, TexturedPixels

WAYS = pytest.mark.parametrize("way", [pickle, cloudpickle], ids=["pickle", "cloudpickle"])


@segar.relation
def is_light(m: Mass) -> bool:
    return m < 2.0


@segar.rule(relation=is_light & is_equal(segar.Mobile, True))
def shake(body: Tuple[Velocity, Mass]) -> SetFactor[Velocity]:
    v, m = body
    return SetFactor[Velocity](v, v + segar.Vector((segar.random.normal(0.0, 0.1), 0.0)) / m)


def thin(m: Mass) -> SetFactor[Mass]:
    return SetFactor[Mass](m, m * 0.99)


def of_closures(rate: float) -> tuple[segar.World, segar.Task]:
    """A world and a task whose functions have no names of their own, with hints that are strings."""

    @segar.rule(priority=9)
    def grow(m: Mass) -> SetFactor[Mass]:
        return SetFactor[Mass](m, m * rate)

    def push(ball: GolfBall, action: segar.Action) -> SetFactor[Velocity]:
        return SetFactor[Velocity](ball[Velocity], ball[Velocity] + rate * segar.Vector((action[0], action[1])))

    def weight(ball: GolfBall) -> float:
        return ball[Mass] * rate

    def heavier(factors: Factors, at_least: float = 0.0) -> np.ndarray:
        return np.nanmax(factors["Mass"], axis=1) > max(rate, at_least)

    return segar.World((segar.move, thin, grow, shake)), segar.Task(
        "weighing", push, weight, results={"heavier": heavier}
    )


DISTRIBUTION = segar.LevelDistribution(
    numbers=[(GolfBall, 1), (GoalTile, 1)],
    priors=[segar.Prior(Position, segar.RandomUniformLocation()), segar.Prior(segar.Size, 0.21, relation=is_light)],
).with_rules((segar.move, shake))


def trail(env: Any, steps: int = 12) -> list[Any]:
    """What an environment shows under the actions that it draws itself."""
    found = []
    for _ in range(steps):
        observation, reward, terminated, truncated, info = env.step(env.action_space.sample())
        plain = {name: value for name, value in info.items() if not name.startswith(("final", "_final"))}
        found.append((observation, reward, terminated, truncated, plain))
        if isinstance(env, gymnasium.Env) and (terminated or truncated):
            env.reset()
    return found


def assert_same(a: Any, b: Any) -> None:
    if isinstance(a, dict):
        assert a.keys() == b.keys()
        for name in a:
            assert_same(a[name], b[name])
    elif isinstance(a, list | tuple):
        assert len(a) == len(b)
        for one, other in zip(a, b, strict=True):
            assert_same(one, other)
    else:
        np.testing.assert_array_equal(a, b)


@WAYS
@pytest.mark.parametrize(
    "task", ["billiards", *(pytest.param(name, marks=pytest.mark.slow) for name in ("puttputt", "invisiball"))]
)
def test_an_environment_in_the_midst_of_its_episodes_goes_on_to_the_bit(way, task):
    levels = segar.family(task).sample(5, seed=0)
    env = VectorEnv(levels, 4, max_steps=9)
    env.action_space.seed(3)
    env.reset()
    trail(env, 7)
    other = way.loads(way.dumps(env))
    assert other.spec == env.spec and other.simulator.source.text == env.simulator.source.text
    assert_same(trail(other), trail(env))


@pytest.mark.parametrize(
    "observation",
    [Pixels(32), TexturedPixels("one", 32), Stack(Pixels(32), 3), {"eye": Stack("state", 2), "body": ("state", "rgb")}],
    ids=["pixels", "textures", "stack", "parts"],
)
def test_every_observation_goes_on_to_the_bit(observation):
    env = VectorEnv(segar.family("empty-hard").sample(5, seed=0), 3, observation=observation, seed=2, max_steps=9)
    env.action_space.seed(3)
    env.reset()
    trail(env, 4)
    other = pickle.loads(pickle.dumps(env))
    assert_same(trail(other), trail(env))


@pytest.mark.parametrize("render_mode", [None, "rgb_array"])
def test_a_single_environment_goes_on_to_the_bit(render_mode):
    env = gymnasium.make(
        "Segar-objectsx1-hard-state-linear-v0", num_levels=4, max_episode_steps=9, render_mode=render_mode
    )
    env.action_space.seed(3)
    env.reset(seed=1)
    trail(env, 4)
    other = pickle.loads(pickle.dumps(env))
    assert other.spec == env.spec
    if render_mode:
        np.testing.assert_array_equal(other.render(), env.render())
    assert_same(trail(other), trail(env))


def test_an_environment_that_was_never_reset_starts_the_same_episodes():
    env = VectorEnv(segar.family("empty-hard").sample(50, seed=0), 4)  # of fresh entropy
    other = pickle.loads(pickle.dumps(env))
    with pytest.raises(SegarError, match="call reset"):
        other.step(np.zeros((4, 2)))
    assert_same(other.reset(), env.reset())


@pytest.mark.parametrize("context", [pytest.param("fork", marks=pytest.mark.slow), "spawn"])
def test_environments_run_in_processes_of_their_own(context):
    id_ = "Segar-empty-hard-state-v0"
    apart = gymnasium.make_vec(
        id_, num_envs=1, vectorization_mode="async", vector_kwargs={"context": context}, num_levels=5
    )
    together = gymnasium.make_vec(id_, num_envs=1, vectorization_mode="sync", num_levels=5)
    try:
        seen = [env.reset(seed=[1]) for env in (apart, together)]
        np.testing.assert_array_equal(seen[0][0], seen[1][0])
        apart.action_space.seed(0)
        for _ in range(3):
            actions = apart.action_space.sample()
            a, b = (env.step(actions) for env in (apart, together))
            for one, other in zip(a[:4], b[:4], strict=True):
                np.testing.assert_array_equal(one, other)
            assert_same(a[4], b[4])
    finally:
        apart.close()
        together.close()


@WAYS
def test_rules_and_relations_of_a_module_are_themselves_again(way):
    for thing in (shake, is_light, *segar.DEFAULT_RULES, segar.is_on):
        assert way.loads(way.dumps(thing)) is thing
    assert way.loads(way.dumps(segar.World((segar.move, shake)))).rules == (segar.move, shake)


@WAYS
def test_worlds_and_tasks_of_closures_behave_as_they_did(way):
    world, task = of_closures(1.5)
    levels = DISTRIBUTION.sample(5, seed=0)
    env = VectorEnv(levels, 3, world=world, task=task, seed=1, max_steps=9)
    env.action_space.seed(3)
    env.reset()
    others = [way.loads(way.dumps(env)), VectorEnv(*way.loads(way.dumps((levels, 3))), world=way.loads(way.dumps(world)),
              task=way.loads(way.dumps(task)), seed=1, max_steps=9)]  # fmt: skip
    others[1].action_space.seed(3)
    others[1].reset()
    expected = trail(env)
    assert task.results_of(env.factors)["heavier"].any()
    for other in others:
        assert other.simulator.source.text == env.simulator.source.text
        assert_same(trail(other), expected)


@WAYS
@pytest.mark.parametrize("name", ["tilesx2-medium", "objectsx3-hard", "billiards", "own"])
def test_distributions_sample_the_same_levels(way, name):
    distribution = DISTRIBUTION if name == "own" else segar.family(name)
    other = way.loads(way.dumps(distribution))
    assert other.hash == distribution.hash
    assert getattr(other.world, "rules", None) == getattr(distribution.world, "rules", None)
    a, b = distribution.sample(20, seed=3), other.sample(20, seed=3)
    assert_same([a.values, a.vertices, a.parameters], [b.values, b.vertices, b.parameters])


def test_what_cannot_be_pickled_is_named_with_what_to_do():
    lock = threading.Lock()

    def report(factors: Factors) -> np.ndarray:
        with lock:
            return factors["Mass"]

    task = dataclasses.replace(segar.puttputt(), results={"weights": report})
    env = VectorEnv(segar.family("empty-easy").sample(2), 1, task=task)
    for thing in (task, env):
        with pytest.raises(SegarError, match=r"report \(test_pickles.py:\d+\) cannot be pickled: .*lock.*top level"):
            pickle.dumps(thing)


def test_a_copy_of_an_environment_goes_its_own_way():
    env = Env(segar.family("empty-hard").sample(5, seed=0), seed=0)
    env.action_space.seed(3)
    env.reset()
    other = copy.deepcopy(env)
    expected = trail(copy.deepcopy(env))
    trail(env, 3)
    assert_same(trail(other), expected)
