"""Levels that are replaced and weighted while environments run, in every interface."""

import pickle
from collections.abc import Callable
from typing import Any

import gymnasium
import numpy as np
import pytest

import segar
from segar.envs import Env, SB3VecEnv, TorchRLEnv, VectorEnv
from segar.errors import LevelError
from segar.observations import PreviousStep, Stack

DIST = segar.family("objectsx1-easy")
LEVELS = DIST.sample(8, seed=0)
OTHERS = DIST.sample(8, seed=1)
N, STEPS = 5, 4  # environments, steps of an episode
OBSERVATIONS = ["state", "rgb", ("textures", Stack("state", 2), PreviousStep())]


def make(levels: segar.Levels = LEVELS, num_envs: int = N, **options: Any) -> VectorEnv:
    return VectorEnv(levels, num_envs, **{"seed": 3, "max_steps": STEPS, **options})


def actions_of(seed: int, steps: int, num_envs: int = N) -> np.ndarray:
    return np.random.default_rng(seed).uniform(-1, 1, (steps, num_envs, 2)).astype(np.float32)


def flat(observation: Any) -> bytes:
    parts = observation if isinstance(observation, tuple) else (observation,)
    return b"".join(np.ascontiguousarray(part).tobytes() for part in parts)


def played(env: VectorEnv, steps: int, seed: int = 0) -> list[tuple[Any, ...]]:
    """What ``steps`` steps return, as bytes and lists."""
    found = []
    for action in actions_of(seed, steps, env.num_envs):
        seen, reward, *_, info = env.step(action)
        found.append((flat(seen), reward.tobytes(), info["level"].tolist(), info["length"].tolist()))
    return found


def levels_started(env: VectorEnv, episodes: int) -> np.ndarray:
    """The level of each episode, ``[episode, env]``; episodes end by time alone."""
    _, info = env.reset(seed=9)
    found = [info["level"]]
    for _ in range((episodes - 1) * env.task.max_steps):
        *_, info = env.step(np.zeros((env.num_envs, 2), np.float32))
        if (info["length"] == 0).all():
            found.append(info["level"])
    return np.array(found)


@pytest.mark.parametrize("weights", [None, np.full(8, 0.7)])
def test_equal_weights_draw_the_levels_of_a_uniform_draw(weights):
    plain, weighted = make(), make()
    weighted.set_level_weights(np.arange(8) + 1.0)
    weighted.set_level_weights(weights)
    assert flat(plain.reset()[0]) == flat(weighted.reset()[0])
    assert played(plain, 6 * STEPS) == played(weighted, 6 * STEPS)


def test_levels_are_drawn_in_proportion_to_their_weights():
    env, weights = make(num_envs=2000, max_steps=1), np.array([0.0, 1, 2, 0, 3, 4, 0, 0])
    env.set_level_weights(weights)
    counts = np.bincount(levels_started(env, 20).ravel(), minlength=8)
    expected = counts.sum() * weights / weights.sum()
    assert not counts[weights == 0].any()
    drawn = weights > 0
    chi_square = ((counts - expected)[drawn] ** 2 / expected[drawn]).sum()
    assert chi_square < 16.3  # three degrees of freedom: 0.1 % of all seeds exceed this


def test_an_environment_draws_the_same_levels_in_a_batch_of_any_size_and_with_any_threads():
    large, small, threaded = make(num_envs=40), make(num_envs=2), make(num_envs=40, num_threads=3)
    for env in (large, small, threaded):
        env.set_level_weights(np.arange(8.0))
    expected = levels_started(large, 10)
    np.testing.assert_array_equal(expected[:, :2], levels_started(small, 10))
    np.testing.assert_array_equal(expected, levels_started(threaded, 10))


@pytest.mark.parametrize("observation", OBSERVATIONS, ids=["state", "rgb", "past"])
def test_levels_that_were_replaced_are_played_as_if_they_had_been_there_from_the_start(observation):
    mixed = make(OTHERS, observation=observation)
    env = make(observation=observation)
    env.reset()
    played(env, 2 * STEPS + 1)
    env.replace_levels(np.arange(8)[::-1], OTHERS[np.arange(8)[::-1]])
    assert flat(env.reset(seed=5)[0]) == flat(mixed.reset(seed=5)[0])
    assert played(env, 5 * STEPS) == played(mixed, 5 * STEPS)


@pytest.mark.parametrize("trials", [1, 3])
def test_running_episodes_and_their_trials_end_on_their_own_level(trials):
    seen = OBSERVATIONS[2] if trials == 1 else "state"  # textures draw anew in each trial
    options: dict[str, Any] = {"observation": seen, "trials": trials}
    env, untouched = make(**options), make(**options)
    for one in (env, untouched):
        one.reset()
        one.step(np.zeros((N, 2), np.float32))
    env.replace_levels(np.arange(8), OTHERS)
    steps = trials * STEPS - 2  # until the last step of the last trial
    for (seen, reward, level, _), (seen_before, reward_before, _, _) in zip(
        played(env, steps), played(untouched, steps), strict=True
    ):
        assert (seen, reward) == (seen_before, reward_before)
        assert level == [-1] * N
    *_, info = env.step(np.zeros((N, 2), np.float32))
    np.testing.assert_array_equal(info["final_info"]["level"], -1)
    assert (info["level"] >= 0).all()
    np.testing.assert_array_equal(env._episodes.now.state.values, OTHERS.values[info["level"]])
    np.testing.assert_array_equal(env.levels.values, OTHERS.values)


def test_a_level_keeps_its_running_episodes_when_it_is_replaced_twice():
    env, untouched = make(), make()
    for one in (env, untouched):
        one.reset()
    env.replace_levels(np.arange(8), OTHERS)
    env.replace_levels(np.arange(8), DIST.sample(8, seed=2))
    for ours, theirs in zip(played(env, STEPS - 1), played(untouched, STEPS - 1), strict=True):
        assert ours[:2] == theirs[:2]


def changed(**options: Any) -> VectorEnv:
    """Environments in the middle of episodes, one of which plays a level that was replaced."""
    env = make(observation=OBSERVATIONS[2], trials=2, **options)
    env.reset()
    played(env, STEPS + 1)
    playing = env._episodes.now.state.level[:2]
    env.replace_levels(np.unique(playing), OTHERS[: len(np.unique(playing))])
    env.set_level_weights(np.arange(8.0))
    return env


def test_a_snapshot_with_its_pool_and_a_pickle_go_on_to_the_bit():
    env = changed()
    snapshot, pool, copy = env.state(), env.pool, pickle.loads(pickle.dumps(env))
    other = make(observation=OBSERVATIONS[2], trials=2)
    other.restore(snapshot, other.pool.with_arrays(pool.arrays()))
    expected = played(env, 8 * STEPS)
    assert expected == played(other, 8 * STEPS) == played(copy, 8 * STEPS)
    env.restore(snapshot, pool)
    assert expected == played(env, 8 * STEPS)


def test_levels_of_one_split_keep_their_origin_and_others_have_none():
    env = make()
    env.replace_levels([0, 1], DIST.sample(10, seed=0)[[8, 9]])
    assert env.levels == DIST.sample(10, seed=0)[[8, 9, 2, 3, 4, 5, 6, 7]]
    env.replace_levels([0, 1], OTHERS[:2])
    assert env.levels.provenance.distribution == ""
    assert env.levels.distribution is DIST


NAMED: dict[str, Any] = {"max_episode_steps": STEPS, "num_levels": 8, "seed": 0}
FACES: dict[str, Callable[[], Any]] = {
    "env": lambda: Env(LEVELS, seed=3, max_steps=STEPS),
    "gym": lambda: gymnasium.make("Segar-objectsx1-easy-state-v0", **NAMED).unwrapped,
    "gym_vector": lambda: gymnasium.make_vec("Segar-objectsx1-easy-state-v0", num_envs=1, **NAMED).unwrapped,
    "torchrl": lambda: TorchRLEnv(LEVELS, 1, seed=3, max_steps=STEPS),
    "sb3": lambda: SB3VecEnv(LEVELS, 1, seed=3, max_steps=STEPS),
}


@pytest.mark.parametrize("kind", FACES)
def test_all_interfaces_take_levels_and_weights(kind):
    env = FACES[kind]()
    env.reset()
    for name, given in (("replace_levels", ([3], OTHERS[:1])), ("set_level_weights", (np.eye(8)[3],))):
        if kind == "sb3":
            env.env_method(name, *given)
        else:
            getattr(env.vector_env if kind == "torchrl" else env, name)(*given)
    seen = env.reset()["observation" if kind == "torchrl" else 0]
    np.testing.assert_array_equal(np.ravel(seen), make(OTHERS[:1], 1).reset()[0].ravel())


def test_a_picture_shows_the_level_that_took_the_place_of_another():
    env, alone = (Env(levels, render_mode="rgb_array", seed=3) for levels in (LEVELS[:1], OTHERS[:1]))
    env.reset()
    env.replace_levels([0], OTHERS[:1])
    for one in (env, alone):
        one.reset()
    np.testing.assert_array_equal(env.render()[:512], alone.render()[:512])  # below stands which level it is


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda env: env.set_level_weights([1.0, 2.0]), r"shape \(8,\), one for each level, not \(2,\)"),
        (lambda env: env.set_level_weights([-1.0] * 8), "at least 0, and that of level 0 is -1"),
        (lambda env: env.set_level_weights([np.nan] * 8), "finite and at least 0"),
        (lambda env: env.set_level_weights(np.zeros(8)), "a finite sum above 0"),
        (lambda env: env.set_level_weights(["a"] * 8), "8 numbers"),
        (lambda env: env.replace_levels([8], OTHERS[:1]), r"0\.\.7, and one is 8"),
        (lambda env: env.replace_levels([1, 1], OTHERS[:2]), "named twice"),
        (lambda env: env.replace_levels([1], OTHERS), "8 whole numbers, one for each"),
        (lambda env: env.replace_levels([1], segar.family("tilesx1-easy").sample(1)), "other environments"),
        (lambda env: env.replace_levels([1], DIST.with_rules([segar.move]).sample(1)), "those of these environments"),
    ],
)
def test_what_does_not_fit_is_said(call, message):
    env = make()
    env.reset()
    with pytest.raises(LevelError, match=message):
        call(env)
    assert env.pool.is_plain
