"""Playing by portable networks, beside torch in float32: agents with random weights on drawn levels, drawing included."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from functools import partial

import numpy as np
import torch

import segar
from benchmarks.measure import Row, in_turns
from segar.experiments.algorithms.portable import network_of
from segar.experiments.algorithms.ppo import PPO
from segar.experiments.networks.encoders import initialize
from segar.experiments.settings import PPOConfig
from segar.policies import NetworkPolicy

FAMILY = "objectsx3-hard"
LEVELS, STEPS = 100, 10
ENCODERS = {"small": None, "keypoints": None, "nature": 3000.0, "impala": None}  # and their bars [µs]


def networks(repeats: int) -> Iterator[Row]:
    """Microseconds of one core for a step with a frame of 64 x 64 x 3, with 100 levels at once."""
    torch.set_num_threads(1)
    levels = segar.family(FAMILY).sample(LEVELS, seed=0)
    env = segar.envs.VectorEnv(levels, LEVELS, seed=0, observation="rgb")
    shape = env.observation.space.shape
    for encoder, bar in ENCODERS.items():
        policy = PPO.make_policy(PPOConfig(encoder=encoder, precision="fp32"), shape, 2)  # type: ignore[arg-type]
        initialize(policy, torch.Generator().manual_seed(0))
        portable = NetworkPolicy(network_of(policy, shape, env.task))  # type: ignore[arg-type]
        players = (portable, partial(policy.act, rng=None))
        mine, theirs = in_turns([partial(play, env, player) for player in players], repeats, time.process_time)
        each = [seconds / (LEVELS * STEPS) * 1e6 for seconds in mine]
        yield Row(f"a step by {encoder}, portable", each, "µs", at_most=bar, note="physics, frames")
        yield Row("  portable / torch", [a / b for a, b in zip(mine, theirs, strict=True)], "x")


def play(env: segar.envs.VectorEnv, player: Callable[[np.ndarray], np.ndarray]) -> None:
    """The steps, on all levels at once."""
    observation, _ = env.reset(options={"levels": np.arange(LEVELS)})
    for _ in range(STEPS):
        observation = env.step(player(observation))[0]
