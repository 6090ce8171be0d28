"""Portable networks act as torch's do, whatever the architecture; what has no portable form is refused by name."""

import dataclasses

import numpy as np
import pytest
import torch
from torch import nn

from segar.experiments.algorithms import PPOPolicy, learner_class
from segar.experiments.algorithms.portable import PortableAgent, network_of
from segar.experiments.networks.encoders import FrameEncoder, initialize
from segar.experiments.settings import KINDS, ConfigError
from segar.experiments.settings.algorithms import CNNS
from segar.policies import NetworkPolicy
from segar.policies.kernels import normal
from segar.tasks import puttputt
from tests.segar.policies.networks import KEYS, environments

TOLERANCE = 1e-5  # of actions
FRAMES, STACKS, VECTORS = (64, 64, 3), (64, 64, 6), (23,)
FLOAT32 = {"precision": "fp32"}
CASES = {
    "states": (KINDS["ppo"](), VECTORS),
    "states, linear heads": (KINDS["ppo"](widths=(30, 7), head_width=0, shared=False), VECTORS),
    **{f"{name}, frames": (KINDS["ppo"](encoder=name, **FLOAT32), FRAMES) for name in CNNS},
    **{f"{name}, stacks": (KINDS["ppo"](encoder=name, **FLOAT32), STACKS) for name in CNNS},
    "odd frames": (KINDS["ppo"](encoder="impala", **FLOAT32), (37, 51, 4)),
    "ppg": (KINDS["ppg"](encoder="small", **FLOAT32), FRAMES),
    "gru": (KINDS["ppo_recurrent"](encoder="small", core_width=37, **FLOAT32), FRAMES),
    "lstm": (KINDS["ppo_recurrent"](core="lstm"), VECTORS),
    "sac": (KINDS["sac"](), VECTORS),
    "drq": (KINDS["drq"](**FLOAT32), STACKS),
    "drq of 2022": (KINDS["drq"](encoder="cnn_2022", **FLOAT32), FRAMES),
}


def random_policy(config, shape, seed=1):
    """A policy with random weights and biases."""
    policy = learner_class(config).make_policy(config, shape, 2)
    rng = torch.Generator().manual_seed(seed)
    initialize(policy, rng)
    for weights in policy.parameters():
        if weights.dim() == 1:
            nn.init.normal_(weights, 0.0, 0.2, generator=rng)
    return policy


def made(case):
    """A random policy of a case, its portable network, and the shape of what it sees."""
    shape = CASES[case][-1]
    policy = random_policy(*CASES[case])
    return policy, network_of(policy, shape, puttputt()), shape


def observations(shape, n, seed):
    rng = np.random.default_rng(seed)
    if len(shape) == 3:  # a disc of some colour on ground of another
        at, radius = rng.uniform(10, 40, (2, n, 1, 1)), rng.uniform(5, 20, (n, 1, 1))
        y, x = np.indices(shape[:2])
        inside = (y - at[0]) ** 2 + (x - at[1]) ** 2 < radius**2
        colours = rng.integers(0, 256, (2, n, 1, 1, shape[2]))
        return np.where(inside[..., None], *colours).astype(np.uint8)
    return rng.normal(size=(n, *shape)).astype(np.float32)


@pytest.mark.parametrize("case", CASES)
def test_actions_are_those_of_torch(case):
    policy, network, shape = made(case)
    agent, env = PortableAgent(network, num_threads=1), environments(KEYS[:6], network)
    for one in (policy, agent):
        if hasattr(one, "begin"):
            one.begin(env)
    acted = []
    for step in range(4):
        seen = observations(shape, 6, step)
        acted.append(agent.act(seen, rng=None))
        np.testing.assert_allclose(acted[-1], policy.act(seen, rng=None), atol=TOLERANCE, rtol=0)
    assert np.std(acted, axis=(0, 1)).min() > 10 * TOLERANCE  # the agents see what they are shown


@pytest.mark.parametrize("case", ["states", "gru", "sac", "drq"])
def test_sampled_actions_have_the_mean_and_the_scale_of_torch(case):
    policy, network, shape = made(case)
    same, many = observations(shape, 1, 0), np.zeros(400, np.int64)
    sampled = NetworkPolicy(network, sampled=True)
    env = environments(KEYS[: len(many)], network)
    sampled.begin(env)
    acted = sampled(same[many])  # in many environments, in which the same is seen
    with torch.no_grad():
        if case == "gru":
            policy.begin(environments(KEYS[:1], network))
            loc, scale, *_ = policy.step(torch.from_numpy(same), policy.acting)
        else:
            loc, scale, *_ = policy(torch.from_numpy(same))
    noise = np.array([[normal(key, 0, component) for component in range(2)] for key in KEYS[: len(many)]])
    np.testing.assert_allclose(acted, np.tanh(loc.numpy() + scale.numpy() * noise), atol=TOLERANCE, rtol=0)


@pytest.mark.parametrize(
    "case", ["states", "states, linear heads", "small, stacks", "keypoints, frames", "gru", "lstm"]
)
def test_the_value_is_that_of_torch(case):
    policy, network, shape = made(case)
    seen = observations(shape, 6, 0)
    assert network.value is not None
    if hasattr(policy, "begin"):
        policy.begin(environments(KEYS[:6], network))
    with torch.no_grad():
        _, _, value, _ = policy.step(torch.from_numpy(seen), getattr(policy, "acting", torch.empty(0)))
    of_value = dataclasses.replace(network, mean=network.value, log_std=network.value, action_low=(), action_high=())
    player = NetworkPolicy(of_value)
    player.begin(environments(KEYS[:6], of_value))
    np.testing.assert_allclose(player(seen), np.tanh(value.numpy()), atol=TOLERANCE, rtol=0)
    assert value.std() > 10 * TOLERANCE


def test_a_critic_without_a_portable_form_is_left_out():
    policy = random_policy(*CASES["small, frames"])
    whole = network_of(policy, FRAMES, puttputt())
    policy.value[-1] = nn.Sequential(policy.value[-1], nn.Softplus())
    network = network_of(policy, FRAMES, puttputt())
    assert (whole.value is None, network.value) == (False, None)
    assert len(network.layers) < len(whole.layers)
    seen = observations(FRAMES, 3, 0)
    np.testing.assert_array_equal(NetworkPolicy(network)(seen), NetworkPolicy(whole)(seen))


def test_the_range_of_the_task_stands_in_the_network():
    task = dataclasses.replace(puttputt(), action_low=(-3.0, 0.0), action_high=(3.0, 1.0))
    network = network_of(random_policy(*CASES["sac"]), VECTORS, task)
    assert (network.action_low, network.action_high) == ((-3.0, 0.0), (3.0, 1.0))


class Doubled(nn.Module):
    """A layer of somebody's own."""

    def forward(self, x):
        return 2 * x


def hooked():
    layer = nn.Conv2d(16, 32, 4, 2)
    layer.register_forward_hook(lambda module, given, gives: 2 * gives)
    return layer


def with_part(part):
    policy = random_policy(*CASES["small, frames"])
    policy.actor.encoder.trunk[0][2] = part
    return policy


@pytest.mark.parametrize(
    ("part", "message"),
    [
        (Doubled(), r"'actor.encoder.trunk.0.2' of the policy is a .*Doubled, which has no portable form. Evaluate it without"),
        (nn.Conv2d(16, 32, 4, (2, 1)), r"'actor.encoder.trunk.0.2: stride' is \(2, 1\), and must be one number for both sides"),
        (nn.Conv2d(16, 32, 4, 2, groups=2), "'actor.encoder.trunk.0.2' has groups 2"),
        (nn.Conv2d(16, 32, 4, padding="same"), "'actor.encoder.trunk.0.2: padding' is 'same'"),
        (nn.MaxPool2d(2, ceil_mode=True), "'actor.encoder.trunk.0.2' has ceil_mode True"),
        (nn.Flatten(2), "'actor.encoder.trunk.0.2' has start_dim 2"),
        (hooked(), "'actor.encoder.trunk.0.2' has forward hooks"),
        (nn.Conv2d(16, 32, 3, 2), r"has no portable form: layer \d+ \(dense\): .* do not fit"),
    ],
)  # fmt: skip
def test_a_part_without_a_portable_form_is_named_with_the_way_out(part, message):
    with pytest.raises(ConfigError, match=message):
        network_of(with_part(part), FRAMES, puttputt())


def test_a_network_of_somebodys_own_is_portable_if_its_layers_are():
    """One layer stands there twice, others have settings that the built-in networks never have."""
    squash = nn.Tanh()
    trunk = nn.Sequential(
        nn.Conv2d(3, 5, 7, 3, padding=2, bias=False),
        squash,
        nn.MaxPool2d(3, 2),
        squash,
        nn.Flatten(),
        nn.Linear(5 * 10 * 10, 40, bias=False),
        nn.LayerNorm(40, eps=1e-3, elementwise_affine=False),
        squash,
        nn.Linear(40, 256),
    )
    policy = random_policy(*CASES["small, frames"])
    policy.actor.encoder = FrameEncoder(trunk, "fp32")
    seen = observations(FRAMES, 6, 0)
    acted = NetworkPolicy(network_of(policy, FRAMES, puttputt()))(seen)
    np.testing.assert_allclose(acted, policy.act(seen, rng=None), atol=TOLERANCE, rtol=0)
    assert acted.std(0).min() > 10 * TOLERANCE


def test_a_policy_of_somebodys_own_is_refused():
    class Mine(PPOPolicy):
        pass

    with pytest.raises(ConfigError, match=r"the policy is a .*Mine, and only those of the built-in algorithms"):
        network_of(Mine(KINDS["ppo"](), VECTORS, 2), VECTORS, puttputt())
