"""Memory of observations is used again when a caller holds none of it, and never while a caller holds any of it."""

import gc
import pickle

import numpy as np
import pytest
import torch

import segar
from segar.envs import VectorEnv
from segar.envs.buffers import MAX_BUFFERS
from segar.observations import Pixels, Stack, leaves

NUM_ENVS = 8  # their frames are large enough for memory to be used again, their states are not
LEVELS = segar.family("objectsx1-hard").sample(6, seed=0)
OBSERVATIONS = {"state": "state", "rgb": "rgb", "stack": Stack(Pixels(), 2), "both": {"b": "rgb", "a": "state"}}

# What a caller may hold of an array, as an object from which the numbers can be read again.
HELD = {
    "the array": lambda a: a,
    "a slice": lambda a: a[1:3],
    "a row": lambda a: a[0],
    "other bytes": lambda a: a.view(np.uint8),
    "a masked array": lambda a: np.ma.masked_array(a, copy=False),
    "a memoryview": memoryview,
    "a tensor": torch.from_numpy,
    "a part of a tensor": lambda a: torch.from_numpy(a)[1:],
    "through dlpack": torch.from_dlpack,
}


def steps(env: VectorEnv, count: int) -> None:
    """Take steps that end episodes, and hold nothing of what they return."""
    for k in range(count):
        env.step(np.random.default_rng(k).uniform(-1, 1, (env.num_envs, 2)).astype(np.float32))


@pytest.mark.parametrize("observation", OBSERVATIONS.values(), ids=OBSERVATIONS)
@pytest.mark.parametrize("hold", HELD.values(), ids=HELD)
def test_nothing_that_a_caller_holds_is_overwritten(hold, observation):
    env = VectorEnv(LEVELS, NUM_ENVS, observation=observation, seed=0, max_steps=4)
    held = [hold(array) for array in leaves(env.reset()[0])]
    for k in range(8):
        observations, *_, info = env.step(np.full((NUM_ENVS, 2), 0.1 * k, np.float32))
        held += [hold(array) for array in leaves(observations)]
        held += [hold(array) for array in leaves(info.get("final_obs", ()))]
    del observations, info
    before = [np.asarray(one).copy() for one in held]
    steps(env, 3 * MAX_BUFFERS)
    for one, copy in zip(held, before, strict=True):
        np.testing.assert_array_equal(np.asarray(one), copy)


def test_memory_that_nobody_holds_is_used_again():
    env = VectorEnv(LEVELS, NUM_ENVS, observation="rgb", seed=0)
    places = {env.reset()[0].ctypes.data}
    for _ in range(20):
        places.add(env.step(np.zeros((NUM_ENVS, 2), np.float32))[0].ctypes.data)
    assert len(places) <= 2


def test_an_array_outlives_its_environment():
    env = VectorEnv(LEVELS, 4, observation="rgb", seed=0)
    held = env.reset()[0][1:]
    copy = held.copy()
    del env
    gc.collect()
    _ = [np.ones((4, 64, 64, 3), np.uint8) for _ in range(20)]
    np.testing.assert_array_equal(held, copy)


def test_lent_arrays_are_like_others():
    array = VectorEnv(LEVELS, 4, seed=0).reset()[0]
    assert type(array) is np.ndarray and array.flags.writeable and array.flags.c_contiguous and array.flags.aligned
    np.testing.assert_array_equal(pickle.loads(pickle.dumps(array)), array)


def test_final_observations_are_zero_but_for_the_episodes_that_ended():
    env = VectorEnv(LEVELS, 6, seed=0, max_steps=3)
    env.reset(options={"levels": np.arange(6)})
    seen = 0
    for k in range(12):
        _, _, terminated, truncated, info = env.step(np.full((6, 2), 0.3, np.float32))
        if k == 4:
            env.reset(options={"reset_mask": np.arange(6) < 2})  # so that episodes end in different steps
        if "final_obs" in info:
            assert np.array_equal(info["_final_obs"], terminated | truncated)
            assert not info["final_obs"][~info["_final_obs"]].any() and info["final_obs"][info["_final_obs"]].any()
            seen += 1
    assert seen >= 4


def test_without_copies_an_observation_is_overwritten_in_place():
    env = VectorEnv(LEVELS, 4, seed=0, copy=False)
    first = env.reset()[0]
    assert env.step(np.ones((4, 2), np.float32))[0] is first


@pytest.mark.parametrize(
    "hold", [lambda info: info, lambda info: {"factors": info["factors"]}], ids=["info", "factors"]
)
def test_factors_of_a_step_stay_as_they_were_while_they_are_held(hold):
    env = VectorEnv(LEVELS, 4, seed=0, max_steps=3)
    env.reset()
    held = []
    for k in range(8):
        info = env.step(np.full((4, 2), 0.2 * k, np.float32))[-1]
        held.append((hold(info), info["factors"]["Position"]))
    del info
    steps(env, 4)
    for holder, position in held:
        np.testing.assert_array_equal(holder["factors"]["Position"], position)
