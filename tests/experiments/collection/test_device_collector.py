"""Environments on a GPU, which a stub plays: their rollouts and what is learned from them are those of the processor."""

import dataclasses

import pytest
import torch

from experiments.algorithms.ppo import PPO
from experiments.algorithms.recurrent_ppo import RecurrentPPO, RecurrentPPOConfig
from experiments.collection.device_collector import DeviceCollector
from experiments.settings import ConfigError, PPOConfig
from segar import family
from segar.engine.cuda.driver import Driver
from segar.envs import device_episodes
from segar.envs.device_episodes import GPU
from tests.segar.engine.cuda.stub_driver import StubDriver

LEVELS = family("tilesx1-hard").sample(10, seed=0)
SIZE = {"num_envs": 6, "num_steps": 12, "minibatches": 2, "head_width": 0, "widths": (16,), "reward_normalise": True}
KINDS = {"ppo": (PPO, PPOConfig(**SIZE)), "recurrent": (RecurrentPPO, RecurrentPPOConfig(core_width=8, **SIZE))}


@pytest.fixture(autouse=True)
def gpu(monkeypatch) -> None:
    """A driver in whose stead the PTX machine works, on tensors of the processor."""
    monkeypatch.setattr(
        device_episodes, "open_gpu", lambda device: GPU(Driver(StubDriver()).device(), torch.device("cpu"))
    )


def learner(kind, **options):
    learns, config = KINDS[kind]
    env = learns.make_env(LEVELS, config.num_envs, seed=3, max_steps=5, **options)
    return learns(config, env, 1000, 0)


@pytest.mark.parametrize("kind", KINDS)
def test_ppo_collects_and_learns_on_a_gpu_what_it_does_on_the_processor(kind):
    host, device = learner(kind), learner(kind, device="cuda")
    assert isinstance(device.collector, DeviceCollector)
    for _ in range(3):
        (ours, our_figures), (theirs, their_figures) = host.collect(), device.collect()
        assert our_figures == their_figures and our_figures["episode/count"] >= 6
        for field in dataclasses.fields(ours):
            assert torch.equal(getattr(ours, field.name), getattr(theirs, field.name)), field.name
        assert host.learn(ours) == device.learn(theirs)
    state = device.collector.state_dict()
    host.collector.load_state_dict(state)
    device.collector.load_state_dict(state)
    ours, theirs = host.collect()[0], device.collect()[0]
    assert torch.equal(ours.observation, theirs.observation)


def test_a_policy_elsewhere_is_refused():
    env = PPO.make_env(LEVELS, 2, seed=0, device="cuda")
    with pytest.raises(ConfigError, match=r"the policy is on cuda:0 and the environments on cpu; take one of them"):
        DeviceCollector(env, None, 1, torch.device("cuda:0"))  # type: ignore[arg-type]


def test_collecting_ahead_is_refused():
    config = dataclasses.replace(KINDS["ppo"][1], overlap=True)
    with pytest.raises(ConfigError, match=r"algorithm\.overlap"):
        PPO(config, PPO.make_env(LEVELS, config.num_envs, seed=0, device="cuda"), 1000, 0)
