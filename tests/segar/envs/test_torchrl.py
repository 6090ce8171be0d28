"""TorchRL's face of the engine keeps TorchRL's contract for every registered id."""

import gymnasium
import numpy as np
import pytest
import torch
from tensordict import TensorDict
from torchrl.envs.utils import check_env_specs

import segar
from tests.segar.envs.test_gym import IDS, QUICK


def make(id_: str, num_envs: int = 2) -> segar.envs.TorchRLEnv:
    options = gymnasium.registry[id_].kwargs
    levels = segar.family(options["family_name"]).sample(3, seed=0)
    task = segar.puttputt(options["reward"]) if "reward" in options else None
    return segar.envs.TorchRLEnv(levels, num_envs, observation=options["observation"], task=task, seed=0)


@pytest.mark.parametrize("id_", [pytest.param(id_, marks=[pytest.mark.slow] * (id_ not in QUICK)) for id_ in IDS])
def test_the_specs_describe_what_the_environment_does(id_: str) -> None:
    check_env_specs(make(id_))


def test_a_rollout_is_the_vector_environments_rollout() -> None:
    levels = segar.family("objectsx1-hard").sample(5, seed=0)
    ours = segar.envs.TorchRLEnv(levels, 4, seed=3)
    plain = segar.envs.VectorEnv(levels, 4, seed=3, autoreset_mode="Disabled")
    current, (observations, _) = ours.reset(), plain.reset()
    for step in range(20):
        np.testing.assert_array_equal(current["observation"].numpy(), observations)
        action = np.random.default_rng(step).uniform(-1, 1, (4, 2)).astype(np.float32)
        current = ours.step(TensorDict({"action": torch.from_numpy(action)}, [4]))["next"]
        observations, reward, *_ = plain.step(action)
        np.testing.assert_allclose(current["reward"].numpy()[:, 0], reward, rtol=1e-6)
