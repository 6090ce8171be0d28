"""The batched environment: reproducible to the bit, complete at the end of episodes, clear about bad input."""

from dataclasses import replace

import numpy as np
import pytest

import segar
from segar.envs import VectorEnv
from segar.tasks import puttputt

LEVELS = segar.family("objectsx1-hard").sample(20, seed=0)
STEPS = 120


def roll(env: VectorEnv, steps: int = STEPS, rows: int | None = None) -> list[np.ndarray]:
    """Observations, rewards and ends of a rollout whose action for environment e does not depend on the batch."""
    trail = [env.reset(seed=5)[0][:rows].copy()]
    for step in range(steps):
        actions = np.random.default_rng(step).uniform(-1, 1, (env.num_envs, 2))
        observations, reward, terminated, truncated, info = env.step(actions.astype(np.float32))
        found = (observations, reward, terminated, truncated, info["level"], info["return"])
        trail += [array[:rows].copy() for array in found]  # a view would keep the batch
    return trail


def same(a: list[np.ndarray], b: list[np.ndarray]) -> bool:
    return len(a) == len(b) and all(np.array_equal(x, y) for x, y in zip(a, b, strict=True))


def test_an_environment_does_the_same_in_a_batch_of_1_64_and_1024() -> None:
    one, many, most = (roll(VectorEnv(LEVELS, n), 60, rows=1) for n in (1, 64, 1024))
    assert same(one, many) and same(one, most)


def test_two_threads_give_the_same_bits_as_one(eager_threads: None) -> None:
    assert same(roll(VectorEnv(LEVELS, 64)), roll(VectorEnv(LEVELS, 64, num_threads=2)))


def test_levels_are_drawn_uniformly() -> None:
    env = VectorEnv(LEVELS, 4000)
    counts = np.bincount(env.reset(seed=0)[1]["level"], minlength=len(LEVELS))
    chi2 = ((counts - 200) ** 2 / 200).sum()
    assert chi2 < 43.8  # 99.9% quantile with 19 degrees of freedom


def test_reset_starts_the_levels_that_it_is_told() -> None:
    env = VectorEnv(LEVELS, 20)
    wanted = np.arange(20)[::-1].copy()
    _, info = env.reset(options={"levels": wanted})
    assert np.array_equal(info["level"], wanted)
    start = LEVELS.values[wanted][:, :, LEVELS.layout.columns[segar.Mass]]
    np.testing.assert_array_equal(env.factors["Mass"], start)
    np.testing.assert_array_equal(env.factors_of(info)["Mass"], start)
    np.testing.assert_array_equal(info["factors"]["Mass"], np.nan_to_num(start))


def test_actions_are_clipped_to_their_range() -> None:
    env = VectorEnv(LEVELS, 2, seed=0)
    env.reset(options={"levels": np.array([3, 3])})
    observations, *_ = env.step(np.array([[1, -1], [7, -50]], np.float32))
    np.testing.assert_array_equal(observations[0], observations[1])


@pytest.mark.parametrize("name", ["empty-hard", "objectsx3-hard", "tilesx3-hard", "puttputt"])
def test_observations_are_finite_and_shaped_by_the_distribution_not_the_sample(name: str) -> None:
    shapes = set()
    for seed in (0, 1):
        env = VectorEnv(segar.family(name).sample(3, seed=seed), 3, seed=seed)
        observations, _ = env.reset()
        shapes.add(observations.shape)
        for _ in range(5):
            observations = env.step(env.action_space.sample())[0]
            assert np.isfinite(observations).all()
    assert len(shapes) == 1


def test_misspelt_names_get_the_nearest_right_one() -> None:
    env = VectorEnv(LEVELS, 1, seed=0)
    env.reset()
    with pytest.raises(segar.errors.LevelError, match="Did you mean 'Mass'"):
        env.factors["Mas"]
    with pytest.raises(segar.SegarError, match="Did you mean 'linear'"):
        segar.puttputt("liner")


def test_unit_actions_are_mapped_to_the_range_of_the_task_and_back() -> None:
    task = replace(puttputt(), action_low=(-3.0, 0.5), action_high=(7.0, 1.0))
    levels = segar.family("empty-hard").sample(8, seed=0)
    plain, unit = (VectorEnv(levels, 8, task=task, seed=0, unit_actions=chosen) for chosen in (False, True))
    assert (unit.single_action_space.low == -1).all() and (unit.single_action_space.high == 1).all()
    np.testing.assert_array_equal(plain.reset()[0], unit.reset()[0])
    rng = np.random.default_rng(0)
    for _ in range(20):
        given = rng.uniform(-1.2, 1.2, (8, 2)).astype(np.float32)
        mapped = np.array([2.0, 0.75], np.float32) + np.array([5.0, 0.25], np.float32) * np.clip(given, -1, 1)
        np.testing.assert_array_equal(plain.step(mapped)[0], unit.step(given)[0])
        np.testing.assert_allclose(unit.action_range.of_space(mapped), np.clip(given, -1, 1), atol=1e-6)
        assert plain.action_range.of_space(mapped) is mapped


def test_a_task_needs_no_function_but_its_action() -> None:
    def push(ball: segar.GolfBall, action: segar.Action) -> segar.SetFactor[segar.Velocity]:
        return segar.SetFactor[segar.Velocity](ball[segar.Velocity], (action[0], action[1]))

    env = VectorEnv(LEVELS, 3, task=segar.Task("drift", push, max_steps=7), seed=0)
    env.reset()
    for k in range(1, 8):
        _, reward, terminated, truncated, info = env.step(np.full((3, 2), 0.5, np.float32))
        assert not reward.any() and not terminated.any() and not info["success"].any() and not info["death"].any()
        assert truncated.all() == (k == 7)


@segar.rule
def jitter(v: segar.Velocity) -> segar.Differential[segar.Velocity]:
    return segar.Differential[segar.Velocity](v, (segar.random.normal(), 0.0))


def drop(ball: segar.GolfBall, action: segar.Action) -> segar.SetFactor[segar.Velocity]:
    return segar.SetFactor[segar.Velocity](ball[segar.Velocity], (action[0], action[1]))


def slip(ball: segar.GolfBall, action: segar.Action) -> segar.SetFactor[segar.Velocity]:
    return segar.SetFactor[segar.Velocity](ball[segar.Velocity], (action[0], segar.random.uniform()))


def luck(ball: segar.GolfBall) -> float:
    return segar.random.uniform() + 0.0 * ball[segar.Mass]


def fate(ball: segar.GolfBall) -> bool:
    return segar.random.bernoulli(0.5) & (ball[segar.Mass] > 0.0)


@pytest.mark.parametrize(
    ("options", "draws"),
    [
        ({}, False),
        ({"task": segar.Task("drop", drop)}, False),
        ({"world": segar.World(rules=(*segar.DEFAULT_RULES, jitter))}, True),
        ({"task": segar.Task("slip", slip)}, True),
        ({"task": segar.Task("luck", drop, reward=luck)}, True),
        ({"task": segar.Task("fate", drop, terminated=fate)}, True),
    ],
    ids=["default", "task", "rule", "action", "reward", "end"],
)
def test_an_environment_says_whether_two_episodes_of_equal_actions_may_differ(options: dict, draws: bool) -> None:
    env = VectorEnv(LEVELS, 32, seed=0, autoreset_mode="Disabled", **options)
    env.reset(options={"levels": np.zeros(32, int)})
    seen = [env.step(np.full((32, 2), 0.5, np.float32))[:3] for _ in range(5)]
    alike = all((array == array[:1]).all() for step in seen for array in step)
    assert (env.is_random, alike) == (draws, not draws)
