"""What holds for every algorithm: runs repeat bit for bit, go on from checkpoints bit for bit, and owe nothing to torch's
global generator."""

import dataclasses

import numpy as np
import pytest
import torch

from segar.experiments.algorithms.checkpoint import load_newest_policy, resume_checkpoint, save_checkpoint
from segar.experiments.commands.hydra_app import compose
from segar.experiments.levels.builders import make_levels
from segar.experiments.settings import LevelsConfig, ObservationConfig, RunConfig, ScaleConfig, import_object

FEW = {"warmup": 8, "num_steps": 6, "batch_size": 6, "capacity": 64, "widths": (8,)}
PLAIN = {"num_steps": 8, "encoder": "small", "widths": (8,), "minibatches": 2}
SOME = {**PLAIN, "auxiliary_minibatches": 2}
TINY = {
    "ppo": ("rgb", PLAIN),
    "ppo_fast": ("rgb", PLAIN),
    "ppo_procgen": ("rgb", PLAIN),
    "ppo_recurrent": ("rgb", {**PLAIN, "core_width": 8}),
    "sac": ("state", FEW),
    "drq": ("rgb", FEW),
    "drq_2022": ("rgb", FEW),
    "curl": ("rgb", SOME),
    "curl_original": ("rgb", SOME),
    "drac": ("rgb", PLAIN),
    "drac_fast": ("rgb", {**PLAIN, "encoder": "keypoints"}),
    "ppg": ("rgb", {**SOME, "phase": 2, "auxiliary_epochs": 2}),
    "ppg_fast": ("state", {**SOME, "phase": 2}),
    "spr": ("rgb", SOME),
    "spr_original": ("rgb", SOME),
}


def tiny(name):
    """The run of an algorithm as it stands in conf/, with a budget of seconds."""
    observation, changes = TINY[name]
    algorithm = dataclasses.replace(compose([f"algorithm={name}"]).algorithm, num_envs=3, **changes)
    return RunConfig(
        levels=LevelsConfig(train="empty-easy", count=3, test_count=1),
        observation=ObservationConfig(name=observation),
        algorithm=algorithm,
        scale=ScaleConfig(frames=200),
    )


def learner(config, seed=0):
    cls = import_object(config.algorithm.learner, "algorithm")
    train, _ = make_levels(config.levels)
    env = cls.make_env(train, config.algorithm.num_envs, seed=seed, observation=config.observation.name)
    return cls(config.algorithm, env, config.scale.frames, seed)


def weights(one):
    return torch.cat([value.detach().double().flatten() for value in one.policy.state_dict().values()])


def act(policy, env, observation, rng=None):
    """What a policy does first."""
    if hasattr(policy, "begin"):
        policy.begin(env)
    return policy.act(observation, rng=rng)


VARIANTS = ("ppo_procgen", "drq_2022", "curl_original", "spr_original")  # of others here, by settings alone


def iterated(one, times=2):
    """The figures of the learner's next iterations."""
    return [one.iterate() for _ in range(times)]


@pytest.fixture(
    scope="module", params=[pytest.param(name, marks=[pytest.mark.slow] * (name in VARIANTS)) for name in TINY]
)
def config(request):
    return tiny(request.param)


@pytest.fixture(scope="module")
def trained(config, tmp_path_factory):
    """A learner that has learned a little, its figures, and the folder of its checkpoint."""
    folder = tmp_path_factory.mktemp("trained")
    torch.manual_seed(1)
    one = learner(config)
    figures = iterated(one)
    save_checkpoint(folder, config, one, {"seconds": 0.0}, {})
    return one, figures, folder


def test_a_policy_acts_and_represents_and_can_be_filled_without_an_environment(config, trained):
    one, _, folder = trained
    env = type(one).make_env(make_levels(config.levels)[0], 5, seed=0, observation=config.observation.name)
    observation, _ = env.reset()
    policy = type(one).make_policy(config.algorithm, observation.shape[1:], 2)
    assert load_newest_policy(folder, policy) == one.frames
    actions = act(policy, env, observation)
    assert actions.shape == (5, 2) and actions.dtype == np.float32 and (abs(actions) <= 1).all()
    assert (actions == act(one.policy, env, observation)).all()
    draws = [act(policy, env, observation, torch.Generator().manual_seed(seed)) for seed in (0, 0, 1)]
    assert (draws[0] == draws[1]).all() and (draws[0] != draws[2]).any()
    assert policy.represent(observation).shape[0] == 5
    assert np.isfinite(policy.represent(observation)).all()


def test_equal_seeds_give_equal_weights_whatever_torchs_generator_does_and_runs_go_on_bit_for_bit(config, trained):
    one, figures, folder = trained
    torch.manual_seed(2)
    same, other = learner(config), learner(config, seed=1)
    assert iterated(same) == figures and torch.equal(weights(same), weights(one))
    assert np.isfinite([value for iteration in figures for value in iteration.values()]).all()
    iterated(other)
    assert not torch.equal(weights(one), weights(other))
    assert resume_checkpoint(folder, config, other, {}) == {"seconds": 0.0}  # what it knows is forgotten
    assert other.frames == one.frames
    assert iterated(one) == iterated(other)
    assert torch.equal(weights(one), weights(other))
