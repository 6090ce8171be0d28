"""Stable-Baselines3 over one batch of environments, and over single ones in its own ``DummyVecEnv``; its SAC and ours."""

from __future__ import annotations

import dataclasses
import time
from collections.abc import Callable, Iterator

import numpy as np
import stable_baselines3
import torch
import yaml
from stable_baselines3.common.vec_env import DummyVecEnv, VecEnv

import segar
from benchmarks.measure import Row, in_turns
from segar.experiments.algorithms.sac import SAC
from segar.experiments.commands.config_store import CONF
from segar.experiments.settings import SACConfig

SINGLES, BATCH = 8, 64  # environments
STEPS, FRAMES = 1024, 4096  # that are counted: random ones, and those of a training
SAC_FRAMES = 4096
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
    learners = {"SAC of SB3": sb3_sac(), "sac_fast": sac_fast()}
    seconds = in_turns(list(learners.values()), repeats, time.process_time)
    rates = [[SAC_FRAMES / s / 1e3 for s in times] for times in seconds]
    for name, found in zip(learners, rates, strict=True):
        yield Row(f"{name}, 2 updates of 512 per 64 frames", found, "k/s")
    yield Row(
        "the second over the first", [ours / theirs for theirs, ours in zip(*rates, strict=True)], "x", at_least=1.0
    )


def sac_fast() -> Callable[[], object]:
    """Trains a multiple of so many frames by our SAC, as ``algorithm=sac_fast`` is set."""
    settings = yaml.safe_load((CONF / "algorithm" / "sac_fast.yaml").read_text(encoding="utf-8"))
    names = {field.name for field in dataclasses.fields(SACConfig)}
    config = SACConfig(**{name: value for name, value in settings.items() if name in names} | {"widths": (128, 128)})
    env = SAC.make_env(segar.family("empty-hard").sample(50, seed=0), config.num_envs, seed=0, observation="state")
    learner = SAC(config, env, SAC_FRAMES, 0)
    learner.iterate()
    return lambda: [learner.iterate() for _ in range(SAC_FRAMES // (config.num_envs * config.num_steps))]


def sb3_sac() -> Callable[[], object]:
    """Trains so many frames by the SAC of SB3, with environments, updates, batches and networks as ours has them."""
    env = segar.envs.SB3VecEnv(segar.family("empty-hard").sample(50, seed=0), 64, seed=0, observation="state")
    settings = {
        "batch_size": 512,
        "train_freq": 1,
        "gradient_steps": 2,
        "learning_starts": 2048,
        "buffer_size": 100_000,
    }
    model = stable_baselines3.SAC(
        "MlpPolicy", env, **settings, policy_kwargs={"net_arch": [128, 128]}, seed=0, device="cpu"
    )
    model.learn(2 * 2048)
    return lambda: model.learn(SAC_FRAMES, reset_num_timesteps=False)


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
