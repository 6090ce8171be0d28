"""Stable-Baselines3 over one batch of environments, and over single environments in its own ``DummyVecEnv``."""

from __future__ import annotations

import time
from collections.abc import Iterator

import numpy as np
import stable_baselines3
import torch
from stable_baselines3.common.vec_env import DummyVecEnv, VecEnv

import segar
from benchmarks.measure import Row, in_turns

SINGLES, BATCH = 8, 64  # environments
STEPS, FRAMES = 1024, 4096  # that are counted: random ones, and those of a training
STEPS_BAR, TRAINING_BAR = 5.0, 2.0


def frameworks(repeats: int) -> Iterator[Row]:
    """Environment steps and training, both per core-second, and how many times those of single environments they are."""
    torch.set_num_threads(1)
    levels = segar.family("empty-hard").sample(50, seed=0)
    singles: VecEnv = DummyVecEnv([lambda seed=k: segar.envs.Env(levels, seed=seed) for k in range(SINGLES)])
    batch = segar.envs.SB3VecEnv(levels, BATCH, seed=0)
    names = {f"DummyVecEnv of {SINGLES}": singles, f"SB3VecEnv of {BATCH}": batch}
    stepped = in_turns([lambda env=env: roll(env) for env in names.values()], repeats, time.process_time)
    trained = in_turns([trainer(env) for env in names.values()], repeats, time.process_time)
    for what, seconds, count, bar in (
        ("steps", stepped, STEPS, STEPS_BAR),
        ("PPO of SB3", trained, FRAMES, TRAINING_BAR),
    ):
        rates = [[count / s / 1e3 for s in times] for times in seconds]
        for name, found in zip(names, rates, strict=True):
            yield Row(f"{what}, {name}", found, "k/s")
        ratios = [many / few for few, many in zip(*rates, strict=True)]
        yield Row(f"{what}, the second over the first", ratios, "x", at_least=bar)


def roll(env: VecEnv) -> None:
    """So many random steps, through the interface of SB3."""
    env.reset()
    actions = np.random.default_rng(0).uniform(-1, 1, (env.num_envs, 2)).astype(np.float32)
    for _ in range(STEPS // env.num_envs):
        env.step(actions)


def trainer(env: VecEnv) -> object:
    """Trains so many frames, with rollouts and minibatches of the same size whatever the number of environments."""
    settings = {"n_steps": 2048 // env.num_envs, "batch_size": 256, "n_epochs": 4}
    model = stable_baselines3.PPO("MlpPolicy", env, **settings, seed=0, device="cpu")
    return lambda: model.learn(FRAMES)
