"""Environments on a GPU, which a stub plays: what is collected and learned from them is that of the processor."""

import copy
import dataclasses

import pytest
import torch

from segar import family
from segar.experiments.algorithms import PPO, learner_class
from segar.experiments.collection.collector import DeviceCollector
from segar.experiments.settings import KINDS, ConfigError
from segar.observations import Pixels, Stack
from tests.experiments.training.test_on_a_gpu import stub_driver

LEVELS = family("tilesx1-hard").sample(10, seed=0)
STACK = Stack(Pixels(32), 2)
SIZE = {"num_envs": 6, "num_steps": 12, "minibatches": 2, "head_width": 0, "widths": (16,), "reward_normalise": True}
FRAMES = {**SIZE, "num_envs": 4, "num_steps": 6, "encoder": "keypoints", "precision": "fp32"}
PPOS = {
    "ppo": (KINDS["ppo"](**SIZE), "state"),
    "recurrent": (KINDS["ppo_recurrent"](core_width=8, **SIZE), "state"),
    "recurrent, apart": (KINDS["ppo_recurrent"](core_width=8, joins_trials=False, **SIZE), "state"),
    "ppo, stacks": (KINDS["ppo"](**FRAMES), STACK),
}
OTHERS = {
    "curl": (KINDS["curl"](auxiliary_minibatches=2, **FRAMES), STACK),
    "spr": (KINDS["spr"](auxiliary_minibatches=2, model_width=8, **FRAMES), STACK),
    "drac": (KINDS["drac"](shift=2, **FRAMES), STACK),
    "ppg": (KINDS["ppg"](phase=2, auxiliary_minibatches=2, **FRAMES), STACK),
    "sac": (KINDS["sac"](num_envs=4, num_steps=12, warmup=12, batch_size=8, capacity=60, widths=(16,)), "state"),
    "drq": (KINDS["drq"](num_envs=4, num_steps=6, warmup=8, steps_per_update=8, batch_size=4, capacity=60, widths=(16,),
                           precision="fp32"), STACK),
}  # fmt: skip


@pytest.fixture(autouse=True)
def gpu(monkeypatch) -> None:
    """A driver in whose stead the PTX machine works, on tensors of the processor."""
    stub_driver(monkeypatch)


def learner(kind, **options):
    config, observation = {**PPOS, **OTHERS}[kind]
    learns = learner_class(config)
    env = learns.make_env(LEVELS, config.num_envs, seed=3, max_steps=5, observation=observation, **options)
    return learns(config, env, 1000, 0)


@pytest.mark.parametrize(
    ("kind", "trials"),
    [
        ("ppo", 1),
        ("recurrent", 2),
        *(
            pytest.param(*one, marks=pytest.mark.slow)
            for one in (("recurrent", 1), ("recurrent, apart", 2), ("ppo, stacks", 1), ("ppo", 2))
        ),
    ],
)
def test_ppo_collects_and_learns_on_a_gpu_what_it_does_on_the_processor(kind, trials):
    host, device = learner(kind, trials=trials), learner(kind, trials=trials, device="cuda")
    assert isinstance(device.collector, DeviceCollector)
    for _ in range(3):
        (ours, our_figures), (theirs, their_figures) = host.collect(), device.collect()
        assert our_figures == their_figures and our_figures["episode/count"] >= 4
        for field in dataclasses.fields(ours):
            assert torch.equal(getattr(ours, field.name), getattr(theirs, field.name)), field.name
        assert host.learn(ours) == device.learn(theirs)
    state = device.collector.state_dict()
    host.collector.load_state_dict(state)
    device.collector.load_state_dict(state)
    ours, theirs = host.collect()[0], device.collect()[0]
    assert torch.equal(ours.observation, theirs.observation)


@pytest.mark.parametrize(
    "kind", ["sac", *(pytest.param(kind, marks=pytest.mark.slow) for kind in OTHERS if kind != "sac")]
)
def test_all_algorithms_learn_on_a_gpu_what_they_do_on_the_processor(kind):
    host, device = learner(kind), learner(kind, device="cuda")
    for _ in range(2):
        assert host.iterate() == device.iterate()
    resumed = learner(kind, device="cuda")
    resumed.load_state_dict(copy.deepcopy(device.state_dict()))
    resumed.policy.load_state_dict(device.policy.state_dict())
    assert host.iterate() == device.iterate() == resumed.iterate()
    for one in (device, resumed):
        theirs = one.policy.state_dict()
        assert all(torch.equal(weight, theirs[name]) for name, weight in host.policy.state_dict().items())


def test_a_policy_elsewhere_is_refused():
    env = PPO.make_env(LEVELS, 2, seed=0, device="cuda")
    refused = r"the policy is on cuda:0 and the environments on cpu; take one of them"
    with pytest.raises(ConfigError, match=refused):
        DeviceCollector(env, None, 1, torch.device("cuda:0"))  # type: ignore[arg-type]
