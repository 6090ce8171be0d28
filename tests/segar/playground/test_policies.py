"""A page's policy plays whole episodes with the bits of NetworkPolicy, in two browsers."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import segar
from segar.envs import VectorEnv
from segar.observations import PreviousActions, Stack
from segar.playground import make_playground
from segar.policies import Network, NetworkPolicy
from tests.segar.playground.browsers import Browser
from tests.segar.playground.twin_page import assert_played_alike, episodes_of, play_in, play_natively
from tests.segar.policies.networks import Builder

LEVELS = segar.family("objectsx1-hard").sample(8, seed=3)


def shape_of(observation: object, levels: segar.Levels = LEVELS) -> tuple[int, ...]:
    shape = VectorEnv(levels, 1, observation=observation, seed=0).single_observation_space.shape
    assert shape is not None
    return shape


def perceptron(observation: object, levels: segar.Levels = LEVELS) -> Network:
    one, (inputs,) = Builder(), shape_of(observation, levels)
    one.dense(inputs, 24)
    one.add("tanh")
    return one.network((inputs,), 24, **ends())


def convolutional(observation: object) -> Network:
    height, width, depth = shape_of(observation)
    one = Builder(scale=1 / 255)
    one.convolution(8, depth, 6, stride=8)
    one.add("relu")
    one.add("flatten")
    one.dense(height // 8 * (width // 8) * 6, 20)
    one.add("tanh")
    return one.network((height, width, depth), 20, **ends())


def recurrent(observation: object) -> Network:
    one, (inputs,) = Builder(), shape_of(observation)
    width = 12
    one.add(
        "gru", weight_input=(inputs, 3 * width), bias_input=(3 * width,), weight_memory=(width, 3 * width),
        bias_memory=(3 * width,),
    )  # fmt: skip
    return one.network((inputs,), width, **ends())


def ends() -> dict[str, tuple[float, ...]]:
    task = segar.puttputt()
    return {"action_low": tuple(task.action_low), "action_high": tuple(task.action_high)}


PLAYERS: dict[str, tuple[Callable[[], Network], object, bool]] = {
    "state": (lambda: perceptron("state"), "state", False),
    "rgb, drawn": (lambda: convolutional("rgb"), "rgb", True),
    "memory, drawn": (lambda: recurrent("state"), "state", True),
    "stack": (lambda: convolutional("textures_stack2"), "textures_stack2", False),
}


@pytest.mark.parametrize("name", PLAYERS)
def test_a_policy_plays_whole_episodes_to_the_bit(name: str, browser: Browser, tmp_path: Path) -> None:
    make, observation, sampled = PLAYERS[name]
    policy = NetworkPolicy(make(), sampled=sampled)
    browser.show(tmp_path, make_playground(LEVELS, observations=[observation], policy=policy))
    assert_played_alike(LEVELS, [observation], browser, episodes_of(LEVELS, 4, None, np.random.default_rng(5)), policy)


@pytest.mark.parametrize("weights", ["float16", "float8"])
def test_rounded_weights_play_the_rounded_network_to_the_bit(weights: Any, browser: Browser, tmp_path: Path) -> None:
    network = convolutional("rgb")
    rounded = network.in_float16() if weights == "float16" else network.in_float8()
    larger = make_playground(LEVELS, policy=network, weights="float32" if weights == "float16" else "float16")
    made = make_playground(LEVELS, policy=network, weights=weights)
    assert len(made.html) < len(larger.html)
    assert len(make_playground(LEVELS, policy=rounded).html) < len(made.html) + 100
    browser.show(tmp_path, made)
    episodes = episodes_of(LEVELS, 2, None, np.random.default_rng(5))
    found = play_in(browser, episodes)
    assert found == play_natively(LEVELS, ["rgb"], episodes, NetworkPolicy(rounded))
    assert found != play_natively(LEVELS, ["rgb"], episodes, NetworkPolicy(network))
    assert f"rounded to {weights}" in browser.run("return document.getElementById('panels').textContent")


def test_observations_of_the_past_agree(browser: Browser, tmp_path: Path) -> None:
    observations = ("rgb_stack2", PreviousActions(3), Stack("state", 2), Stack(PreviousActions(), 2))
    browser.show(tmp_path, make_playground(LEVELS, observations=observations))
    assert_played_alike(LEVELS, observations, browser, episodes_of(LEVELS, 4, 40, np.random.default_rng(7)))
