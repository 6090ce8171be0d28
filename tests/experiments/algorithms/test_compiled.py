"""The compiled loss: the figures and gradients of the plain one, and runs that are as reproducible with it."""

import dataclasses

import pytest
import torch
from torch._dynamo.exc import BackendCompilerFailed

from segar import family
from segar.experiments.algorithms.ppo import PPO
from segar.experiments.settings import PPOConfig, TrainingError
from segar.experiments.training.run import run
from tests.experiments.short_runs import run_killed, same_results, short_run

VECTORS = PPOConfig(num_envs=6, num_steps=16, minibatches=2, widths=(16,), precision="fp32", compile=True)
FRAMES = dataclasses.replace(VECTORS, encoder="small")
STACKS = dataclasses.replace(VECTORS, encoder="keypoints", steps_together=4)
LEVELS = family("tilesx1-hard").sample(10, seed=0)


def learner(config=VECTORS, observation="state"):
    return PPO(config, PPO.make_env(LEVELS, config.num_envs, seed=0, observation=observation), 10_000, 0)


def gradients(one, compute, minibatch):
    one.optimizer.zero_grad()
    found = compute(minibatch)
    sum(value for name, value in found.items() if name.startswith("loss_")).backward()
    return dict(found.items()), [weight.grad.clone() for weight in one.policy.parameters()]


@pytest.mark.slow
@pytest.mark.parametrize(("config", "observation"), [(VECTORS, "state"), (FRAMES, "rgb"), (STACKS, "rgb_stack2")])
def test_a_compiled_loss_has_the_figures_and_gradients_of_the_plain_one(config, observation):
    one = learner(config, observation)
    one.iterate()  # for a policy that is not the one that collected
    rollout, _ = one.collect()
    for minibatch in list(one.minibatches(one.make_batch(rollout)))[:2]:
        plain, compiled = gradients(one, one.losses, minibatch), gradients(one, one.figures, minibatch)
        assert plain[0].keys() == compiled[0].keys()
        for name, value in plain[0].items():
            torch.testing.assert_close(compiled[0][name], value, rtol=1e-4, atol=1e-5)
        for a, b in zip(plain[1], compiled[1], strict=True):
            torch.testing.assert_close(a, b, rtol=1e-3, atol=1e-5)


@pytest.mark.slow
def test_a_compiled_run_is_reproduced_and_resumed_to_the_bit(tmp_path):
    algorithm = PPOConfig(num_envs=8, num_steps=8, widths=(8,), head_width=0, compile=True, overlap=True)
    runs = [short_run(tmp_path / name, algorithm=algorithm) for name in ("one", "other", "parts")]
    run_killed(runs[2], 2)
    for config in runs:
        run(config)
    for name in ("other", "parts"):
        assert same_results(tmp_path / name, tmp_path / "one")


def test_where_torch_cannot_compile_the_way_out_is_named(monkeypatch):
    def fails(minibatch):
        raise BackendCompilerFailed(print, RuntimeError("no C++ compiler"), [])

    monkeypatch.setattr(torch, "compile", lambda *_, **__: fails)
    with pytest.raises(TrainingError, match=r"no C\+\+ compiler.*algorithm.compile=false"):
        learner().iterate()
