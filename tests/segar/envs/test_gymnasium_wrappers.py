"""Gymnasium's wrappers, all of them, over environments that were made in each way."""

import functools
from collections.abc import Callable, Set
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
import pytest
from gymnasium import spaces, wrappers
from gymnasium.wrappers import vector

import segar
from segar.envs import Env, VectorEnv
from segar.observations import Pixels

ID = "Segar-empty-hard-state-v0"
STEPS = 4  # of an episode
N = 3
LEVELS = segar.family("empty-hard").sample(5, seed=0)
SEEN: dict[str, Any] = {"state": "state", "look": Pixels(32), "both": {"body": "state", "look": Pixels(32)}}
UNIT = spaces.Box(-1, 1, (2,), np.float32)
LARGER = {"min_action": np.float32(-3), "max_action": np.float32(3)}
twice = functools.partial(np.multiply, 2)
halved = {"func": functools.partial(np.multiply, 0.5)}

# What is observed, and the arguments of the wrapper, where they are not the state and none.
SINGLE: dict[str, tuple[str, dict[str, Any]]] = {
    "DelayObservation": ("state", {"delay": 2}),
    "DtypeObservation": ("look", {"dtype": np.int32}),
    "DiscretizeObservation": ("state", {"bins": 3}),
    "FilterObservation": ("both", {"filter_keys": ["body"]}),
    "FlattenObservation": ("both", {}),
    "FrameStackObservation": ("look", {"stack_size": 3}),
    "GrayscaleObservation": ("look", {}),
    "TransformObservation": ("state", {"func": twice, "observation_space": None}),
    "MaxAndSkipObservation": ("look", {"skip": 2}),
    "ReshapeObservation": ("look", {"shape": (32 * 32, 3)}),
    "ResizeObservation": ("look", {"shape": (16, 16)}),
    "RescaleObservation": ("look", {"min_obs": np.uint8(0), "max_obs": np.uint8(1)}),
    "TimeAwareObservation": ("state", {"normalize_time": True}),
    "DiscretizeAction": ("state", {"bins": 3}),
    "TransformAction": ("state", {**halved, "action_space": UNIT}),
    "RescaleAction": ("state", LARGER),
    "StickyAction": ("state", {"repeat_action_probability": 0.5}),
    "RepeatAction": ("state", {"num_repeats": 2}),
    "ClipReward": ("state", {"min_reward": -0.1}),
    "TransformReward": ("state", halved),
    "TimeLimit": ("state", {"max_episode_steps": 3}),
    "AddWhiteNoise": ("state", {"probability_of_noise_per_pixel": 0.5}),
    "ObstructView": ("state", {"obstructed_pixels_ratio": 0.5, "obstruction_width": 8}),
    "RecordVideo": ("state", {"video_folder": "videos", "disable_logger": True}),
    "NumpyToTorch": ("both", {}),
}
VECTOR: dict[str, tuple[str, dict[str, Any]]] = {
    "VectorizeTransformObservation": (
        "state",
        {"wrapper": wrappers.TransformObservation, "func": twice, "observation_space": None},
    ),
    "VectorizeTransformAction": ("state", {"wrapper": wrappers.RescaleAction, **LARGER}),
    "VectorizeTransformReward": ("state", {"wrapper": wrappers.ClipReward, "min_reward": -0.1}),
    "TransformObservation": ("state", {"func": twice}),
    "TransformAction": ("state", halved),
    "TransformReward": ("state", halved),
}
NOT_THERE = {
    "AtariPreprocessing": "wraps Atari's emulator",
    "ArrayConversion": "is NumpyToTorch, with the names of two libraries",
    "JaxToNumpy": "wraps environments of JAX",
    "JaxToTorch": "wraps environments of JAX",
    "vector": "a module",
}
DRAWN = ("AddRenderObservation", "AddWhiteNoise", "ObstructView", "RenderCollection", "RecordVideo", "HumanRendering")


NEED_MORE = {"ResizeObservation", "NumpyToTorch"}  # packages of the extra `slow`


def each(module: Any, need_more: Set[str]) -> list[Any]:
    """The wrappers that this version of Gymnasium has."""
    here = [name for name in module.__all__ if name not in NOT_THERE]
    return [pytest.param(name, marks=[pytest.mark.slow] * (name in need_more)) for name in here]


def options_of(name: str, table: dict[str, tuple[str, dict[str, Any]]]) -> tuple[dict[str, Any], dict[str, Any]]:
    """Of the environment and of the wrapper."""
    observation, options = table.get(name, ("state", {}))
    made: dict[str, Any] = {"observation": SEEN[observation]}
    if name in DRAWN:
        made |= {"render_mode": "rgb_array", "view": segar.rendering.View(size=64)}
    return made, options


def make_by_id(**options: Any) -> gymnasium.Env:
    return gymnasium.make(ID, num_levels=5, max_episode_steps=STEPS, **options)


def make_by_class(**options: Any) -> gymnasium.Env:
    return Env(LEVELS, max_steps=STEPS, **options)


def make_batch_by_id(mode: str) -> Callable[..., gymnasium.vector.VectorEnv]:
    def make(**options: Any) -> gymnasium.vector.VectorEnv:
        if mode == "vector_entry_point":  # wrappers of observations refuse its own mode, SAME_STEP
            options["autoreset_mode"] = "NextStep"
        return gymnasium.make_vec(ID, N, mode, num_levels=5, max_episode_steps=STEPS, **options)

    return make


def make_batch_by_class(**options: Any) -> gymnasium.vector.VectorEnv:
    return VectorEnv(LEVELS, N, max_steps=STEPS, autoreset_mode="NextStep", **options)


WAYS = {
    "sync": make_batch_by_id("sync"),
    "native": make_batch_by_id("vector_entry_point"),
    "class": make_batch_by_class,
    "async": make_batch_by_id("async"),
}


@pytest.fixture(autouse=True)
def _without_windows(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setenv("SDL_VIDEODRIVER", "dummy")
    monkeypatch.chdir(tmp_path)


@pytest.mark.parametrize("make", [make_by_id, pytest.param(make_by_class, marks=pytest.mark.slow)])
@pytest.mark.parametrize("name", each(wrappers, NEED_MORE))
def test_a_wrapper_of_single_environments_plays_episodes(name, make):
    made, options = options_of(name, SINGLE)
    env = make(**made)
    if name == "TimeAwareObservation" and env.spec is None:
        env = wrappers.TimeLimit(env, STEPS)  # an environment without id says no limit
    env = getattr(wrappers, name)(env, **options)
    env.action_space.seed(0)
    ends = 0
    for k in range(2):
        seen, info = env.reset(seed=k)
        for _ in range(STEPS):
            assert name == "NumpyToTorch" or seen in env.observation_space
            assert type(info) is dict
            seen, _, terminated, truncated, info = env.step(env.action_space.sample())
            if terminated or truncated:
                ends += 1
                break
    assert ends == 2 or name == "Autoreset"
    env.close()


@pytest.mark.parametrize("way", [pytest.param(one, marks=[pytest.mark.slow] * (one != "native")) for one in WAYS])
@pytest.mark.parametrize("name", each(vector, NEED_MORE | {"HumanRendering"}))
def test_a_wrapper_of_batches_plays_episodes(name, way):
    made, options = options_of(name, SINGLE | VECTOR)
    env = WAYS[way](**made)
    env = getattr(vector, name)(env, **options)
    env.action_space.seed(0)
    seen, _ = env.reset(seed=0)
    ends = 0
    for _ in range(3 * STEPS):
        assert name == "NumpyToTorch" or seen in env.observation_space
        seen, _, terminated, truncated, info = env.step(env.action_space.sample())
        ends += int((terminated | truncated).sum())
        if name == "DictInfoToList":
            assert len(info) == N and all(type(one) is dict for one in info)
    assert ends >= 2 * N
    env.close()
