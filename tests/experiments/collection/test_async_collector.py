"""Collecting ahead: what the thread collects is what would be collected in turn, and nothing of it is lost by a restart."""

import dataclasses

import pytest
import torch

from segar import family
from segar.errors import ActionError
from segar.experiments.algorithms import PPO, learner_class
from segar.experiments.settings import KINDS
from segar.experiments.training.run import run
from tests.experiments.conftest import Here
from tests.experiments.short_runs import FRAMES, ITERATIONS, run_killed, same_results, short_run

LEVELS = family("tilesx1-hard").sample(10, seed=0)
SIZE = {"num_envs": 6, "num_steps": 16, "minibatches": 2, "head_width": 0, "overlap": True}
SMALL = KINDS["ppo"](widths=(16,), **SIZE)
CASES = {
    "state": (SMALL, "state"),
    "stacks": (dataclasses.replace(SMALL, encoder="keypoints", steps_together=4), "rgb_stack2"),
    "recurrent": (KINDS["ppo_recurrent"](widths=(16,), core_width=8, **SIZE), "state"),
    "curl": (KINDS["curl"](encoder="small", auxiliary_minibatches=2, **SIZE), "rgb"),
    "ppg": (KINDS["ppg"](phase=1, auxiliary_minibatches=2, widths=(16,), **SIZE), "state"),
    "drac": (KINDS["drac"](encoder="small", **SIZE), "rgb"),
}
BATCH = SMALL.num_envs * SMALL.num_steps


def learner(kind="state", seed=0, iterations=5):
    config, observation = CASES[kind]
    learns = learner_class(config)
    env = learns.make_env(LEVELS, config.num_envs, seed=seed, observation=observation)
    return learns(config, env, iterations * BATCH, seed)


@pytest.mark.parametrize("kind", CASES)
def test_a_thread_collects_what_would_be_collected_in_turn(kind):
    ahead, in_turn = learner(kind), learner(kind)
    in_turn.collector.executor = Here()
    for _ in range(5):
        assert ahead.iterate() == in_turn.iterate()
    for a, b in zip(ahead.policy.parameters(), in_turn.policy.parameters(), strict=True):
        assert torch.equal(a, b)


def test_rollouts_are_those_of_the_weights_before_the_last_update():
    one = learner()
    older = newer = {name: value.clone() for name, value in one.policy.state_dict().items()}
    acting = PPO.make_policy(SMALL, one.collector.collector.current.shape[1:], 2)
    for turn in range(5):
        rollout, _ = one.collect()
        acting.load_state_dict(older)
        with torch.no_grad():
            loc, scale, value = acting(rollout.observation)
        torch.testing.assert_close((rollout.loc, rollout.scale, rollout.value), (loc, scale, value))
        one.learn(rollout)
        older, newer = newer, {name: value.clone() for name, value in one.policy.state_dict().items()}
        assert any(not torch.equal(older[name], newer[name]) for name in newer), turn


def test_nothing_is_collected_that_nobody_learns_on():
    one = learner(iterations=3)
    pending = []
    for _ in range(3):
        one.iterate()
        pending.append(one.collector.pending is not None)
    assert pending == [True, True, False]


OVERLAPPING = KINDS["ppo"](num_envs=8, num_steps=8, widths=(8,), head_width=0, overlap=True)


def test_a_resumed_run_collects_again_what_was_being_collected(tmp_path):
    whole, parts = (short_run(tmp_path / name, algorithm=OVERLAPPING) for name in ("whole", "parts"))
    run(whole)
    for killed in (1, 2, 3):
        run_killed(parts, killed)
    assert run(parts).summary["frames"] == FRAMES * ITERATIONS
    assert same_results(tmp_path / "parts", tmp_path / "whole")


def test_what_goes_wrong_while_collecting_is_raised_where_it_is_waited_for():
    one = learner()
    with torch.no_grad():
        one.policy.actor.mean[-1].bias.fill_(float("nan"))
    with pytest.raises(ActionError):
        one.collect()
