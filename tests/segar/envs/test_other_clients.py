"""Packages of others, over environments that were made in each way."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
import pytest
import torch
from gymnasium.vector import SyncVectorEnv
from stable_baselines3.common.env_checker import check_env

import segar
from segar.envs import Env, VectorEnv

STATE, FRAMES = "Segar-empty-hard-state-v0", "Segar-empty-hard-rgb-v0"
LEVELS = segar.family("empty-hard").sample(5, seed=0)
N, STEPS = 3, 4
SINGLE: dict[str, Callable[[], gymnasium.Env]] = {
    "id": lambda: gymnasium.make(STATE, num_levels=5, max_episode_steps=STEPS),
    "frames": lambda: gymnasium.make(FRAMES, num_levels=5, max_episode_steps=STEPS),
    "class": lambda: Env(LEVELS, max_steps=STEPS),
}
BATCHES: dict[str, Callable[[], gymnasium.vector.VectorEnv]] = {
    "native": lambda: gymnasium.make_vec(STATE, N, num_levels=5, max_episode_steps=STEPS),
    "class": lambda: VectorEnv(LEVELS, N, max_steps=STEPS),
    "sync": lambda: SyncVectorEnv([SINGLE["id"]] * N),
    "async": lambda: gymnasium.make_vec(STATE, N, "async", num_levels=5, max_episode_steps=STEPS),
}


@pytest.mark.parametrize("way", SINGLE)
def test_the_checker_of_stable_baselines_passes(way):
    check_env(SINGLE[way]())


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore:.*is (set to )?None:UserWarning")  # who recorded, with which program
@pytest.mark.filterwarnings("ignore:.*Implicitly cleaning up|Exception ignored in")  # Minari's folder
@pytest.mark.parametrize("way", SINGLE)
def test_minari_collects_infos(way, tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    from minari import DataCollector, load_dataset

    monkeypatch.setenv("MINARI_DATASETS_PATH", str(tmp_path))
    env = DataCollector(SINGLE[way](), record_infos=True)
    told: list[list[dict[str, Any]]] = []
    for k in range(2):
        told.append([env.reset(seed=k)[1]])
        terminated = truncated = False
        while not (terminated or truncated):
            _, _, terminated, truncated, info = env.step(env.action_space.sample())
            told[-1].append(info)
    spec = None if way == "class" else STATE
    env.create_dataset("ours/own-v0", eval_env=spec, algorithm_name="random")
    env.close()
    for episode, infos in zip(load_dataset("ours/own-v0"), told, strict=True):
        assert episode.infos["length"].tolist() == [*range(len(infos))]
        for name, array in infos[-1]["factors"].items():
            np.testing.assert_array_equal(episode.infos["factors"][name][-1], array)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("make", "n"),
    [
        *(pytest.param(make, 1, id=f"single {name}") for name, make in SINGLE.items()),
        *(pytest.param(make, N, id=f"batch {name}") for name, make in BATCHES.items()),
    ],
)
def test_skrl_plays_episodes(make, n):
    from skrl.envs.wrappers.torch import wrap_env

    env = wrap_env(make(), wrapper="gymnasium", verbose=False)
    assert env.num_envs == n
    seen, _ = env.reset()
    ends = 0
    for _ in range(2 * STEPS):
        assert seen.shape[0] == n and torch.isfinite(seen.float()).all()
        seen, reward, terminated, truncated, _ = env.step(torch.zeros(n, 2))
        assert reward.shape == terminated.shape == (n, 1)
        ends += int((terminated | truncated).sum())
        if n == 1 and ends:
            break
    assert ends >= n
    env.close()
