"""The modes in which batches start their next episodes: the same episodes in all of them, told as Gymnasium tells them."""

import copy
import pickle
from typing import Any

import numpy as np
import pytest
from gymnasium.vector import AutoresetMode, SyncVectorEnv

import segar
from segar.envs import Env, VectorEnv
from segar.observations import PreviousStep, Stack

LEVELS = segar.family("empty-hard").sample(20, seed=0)
N, STEPS, EPISODES = 4, 5, 3
SEEN: dict[str, Any] = {"last": PreviousStep(), "seen": Stack("state", 2)}


def action_of(env: int, episode: int, step: int) -> np.ndarray:
    return np.random.default_rng((env, episode, step)).uniform(-1, 1, 2).astype(np.float32)


def told(observation: Any, reward: float, terminated: bool, truncated: bool, info: dict[str, Any], e: int) -> list[Any]:
    """What a step says of an environment."""
    figures = [info[name][e] for name in ("level", "return", "length", "success", "death")]
    seen = [observation[name][e] for name in SEEN]
    return [*seen, reward, terminated, truncated, *figures, *(array[e] for array in info["factors"].values())]


def episodes(mode: str, **options: Any) -> dict[tuple[int, int], list[Any]]:
    """The steps of the first episodes of each environment, from their start, with actions that depend on the step alone."""
    env = VectorEnv(LEVELS, N, seed=3, max_steps=STEPS, autoreset_mode=mode, observation=SEEN, **options)
    seen, info = env.reset()
    found = {(e, 0): [told(seen, 0.0, False, False, info, e)] for e in range(N)}
    episode, over = np.zeros(N, int), np.zeros(N, bool)
    while episode.min() < EPISODES:
        actions = np.stack([action_of(e, episode[e], len(found[e, episode[e]])) for e in range(N)])
        seen, reward, terminated, truncated, info = env.step(actions)
        ended = terminated | truncated
        for e in range(N):
            if over[e] and mode == "NextStep":
                episode[e] += 1
                found[e, episode[e]] = [told(seen, reward[e], terminated[e], truncated[e], info, e)]
            elif ended[e] and mode == "SameStep":
                last = told(info["final_obs"], reward[e], terminated[e], truncated[e], info["final_info"], e)
                found[e, episode[e]].append(last)
                episode[e] += 1
                found[e, episode[e]] = [told(seen, 0.0, False, False, info, e)]
            else:
                found[e, episode[e]].append(told(seen, reward[e], terminated[e], truncated[e], info, e))
        over = ended
        if mode == "Disabled" and ended.any():
            seen, info = env.reset(options={"reset_mask": ended})
            assert np.array_equal(info["_level"], ended)
            for e in np.flatnonzero(ended):
                episode[e] += 1
                found[e, episode[e]] = [told(seen, 0.0, False, False, info, e)]
    return {key: steps for key, steps in found.items() if key[1] < EPISODES}


@pytest.mark.parametrize("trials", [1, 2])
def test_all_modes_play_the_same_episodes(trials):
    same, following, disabled = (episodes(mode, trials=trials) for mode in ("SameStep", "NextStep", "Disabled"))
    assert same.keys() == following.keys() == disabled.keys()
    for key, steps in same.items():
        for other in (following, disabled):
            assert len(other[key]) == len(steps)
            for one, another in zip(steps, other[key], strict=True):
                for a, b in zip(one, another, strict=True):
                    np.testing.assert_array_equal(a, b, err_msg=str(key))


@pytest.mark.parametrize("mode", [*AutoresetMode])
def test_a_batch_tells_what_gymnasium_tells_of_single_environments(mode):
    native = VectorEnv(LEVELS, N, max_steps=STEPS, autoreset_mode=mode)
    single = SyncVectorEnv([lambda: Env(LEVELS, max_steps=STEPS)] * N, autoreset_mode=mode)
    assert native.metadata["autoreset_mode"] is mode
    seeds = [5, 5, 7, 8]
    ours, theirs = native.reset(seed=seeds), single.reset(seed=seeds)
    native.action_space.seed(0)
    for _ in range(3 * STEPS + 2):
        assert_equal(ours, theirs)
        action = native.action_space.sample()
        ours, theirs = native.step(action), single.step(action)
        ended = ours[2] | ours[3]
        if mode is AutoresetMode.DISABLED and ended.any():
            assert_equal(ours, theirs)
            ours, theirs = (env.reset(options={"reset_mask": ended.copy()}) for env in (native, single))


def assert_equal(ours: Any, theirs: Any, where: Any = None) -> None:
    """Equal values and types; of infos, where Gymnasium's masks say that there is something."""
    assert type(ours) is type(theirs)
    if isinstance(ours, dict):
        assert ours.keys() == theirs.keys()
        for name in ours:
            mask = theirs.get(f"_{name}")
            if name == "final_obs":  # Gymnasium has an array of objects
                np.testing.assert_array_equal(ours[name][mask], np.stack(theirs[name][mask]))
            else:
                assert_equal(ours[name], theirs[name], mask)
    elif isinstance(ours, tuple):
        for one, other in zip(ours, theirs, strict=True):
            assert_equal(one, other)
    else:
        assert ours.dtype == theirs.dtype and ours.shape == theirs.shape
        at = slice(None) if where is None else where
        np.testing.assert_array_equal(ours[at], theirs[at])


@pytest.mark.parametrize("way", [copy.deepcopy, lambda env: pickle.loads(pickle.dumps(env))], ids=["copy", "pickle"])
@pytest.mark.parametrize("seed", [3, [4, 4, 5, 6]], ids=["one seed", "own seeds"])
def test_a_batch_that_is_about_to_start_episodes_goes_on_elsewhere(way, seed):
    env = VectorEnv(LEVELS, N, max_steps=STEPS, autoreset_mode="NextStep")
    env.reset(seed=seed)
    for _ in range(STEPS):
        *_, truncated, _ = env.step(np.zeros((N, 2), np.float32))
    assert truncated.all()
    restored = VectorEnv(LEVELS, N, max_steps=STEPS, autoreset_mode="NextStep")
    restored.restore(env.state())
    other = way(env)
    for _ in range(2 * STEPS):
        action = np.full((N, 2), 0.5, np.float32)
        expected = env.step(action)
        assert_equal(other.step(action), expected)
        assert_equal(restored.step(action), expected)


def test_an_environment_whose_seed_is_none_starts_at_random():
    env = VectorEnv(LEVELS, N)
    assert len({int(env.reset(seed=[1, 1, 1, None])[1]["level"][3]) for _ in range(20)}) > 1
