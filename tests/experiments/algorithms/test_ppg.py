"""PPG: its losses by hand, what an auxiliary phase changes and what it keeps, and when there is one."""

import dataclasses

import pytest
import torch

from segar import family
from segar.experiments.algorithms.ppg import PPG, auxiliary_losses, mean_of_rollouts
from segar.experiments.algorithms.ppo import PPO
from segar.experiments.settings import ConfigError, PPGConfig

LEVELS = family("objectsx1-easy").sample(5, seed=0)
CONFIG = PPGConfig(
    num_envs=8, num_steps=16, minibatches=2, widths=(32,), head_width=0, phase=3, auxiliary_minibatches=2,
    learning_rate=1e-3, auxiliary_learning_rate=1e-3, gamma=0.9, reward_transform="sqrt", clip_value=None,
)  # fmt: skip
ROLLOUT = 8 * 16


def learner(config=CONFIG, seed=0, observation="state", budget=100 * ROLLOUT):
    return PPG(config, PPG.make_env(LEVELS, config.num_envs, seed=seed, observation=observation), budget, seed)


def after_a_policy_phase(config=CONFIG, **options):
    """A learner before its first auxiliary phase."""
    one = learner(config, **options)
    for _ in range(config.phase):
        PPO.iterate(one)
    return one


def moved_by(phase, policy):
    """The parts of the policy whose weights a phase changes."""
    before = {name: value.clone() for name, value in policy.state_dict().items()}
    phase()
    return {name.split(".")[0] for name, weight in policy.state_dict().items() if not torch.equal(weight, before[name])}


def test_the_losses_are_those_of_their_definition_and_so_are_their_gradients():
    one = after_a_policy_phase()
    batch = one.auxiliary_batch().flatten()
    one.learn_auxiliary()  # for a policy that is not the one before
    found, policy = auxiliary_losses(one.policy, batch), one.policy
    loc, scale, hidden = policy.actor(batch["observation"])
    m, s, target = batch["loc"], batch["scale"], batch["value_target"]
    divergence = ((scale / s).log() + (s**2 + (m - loc) ** 2) / (2 * scale**2) - 0.5).sum(-1)
    values = policy.auxiliary(hidden), policy.value(batch["observation"])
    plain = [divergence.mean(), *(0.5 * ((value - target) ** 2).mean() for value in values)]
    torch.testing.assert_close(list(found), plain, rtol=1e-4, atol=1e-6)
    weights = [*policy.parameters()]
    gradients = (torch.autograd.grad(2.0 * clone + aux + value, weights) for clone, aux, value in (found, plain))
    for a, b in zip(*gradients, strict=True):
        torch.testing.assert_close(a, b, rtol=1e-4, atol=1e-6)


def test_an_auxiliary_phase_lowers_the_error_of_both_values_and_the_clone_term_keeps_the_policy():
    changed, errors = {}, {}
    for coef in (0.0, 1.0, 10.0):
        one = after_a_policy_phase(dataclasses.replace(CONFIG, clone_coef=coef))
        batch = one.auxiliary_batch().flatten()
        before = losses_of(one, batch)
        one.learn_auxiliary()
        changed[coef], *errors[coef] = losses_of(one, batch)
        assert before[0] == pytest.approx(0.0, abs=1e-6)
        assert errors[coef][0] < 0.5 * before[1] and errors[coef][1] < 0.5 * before[2]
    assert changed[1.0] < 0.2 * changed[0.0] and changed[10.0] < 0.5 * changed[1.0]
    assert errors[1.0][0] < 1.3 * errors[0.0][0]


def losses_of(one, batch):
    with torch.no_grad():
        return [loss.item() for loss in auxiliary_losses(one.policy, batch)]


def test_policy_and_value_share_no_weight_and_a_policy_phase_leaves_the_auxiliary_head_alone():
    one = learner()
    actor, value, auxiliary = (
        {id(w) for w in m.parameters()} for m in (one.policy.actor, one.policy.value, one.policy.auxiliary)
    )
    assert not actor & value and not auxiliary & (actor | value)
    assert moved_by(lambda: PPO.iterate(one), one.policy) == {"actor", "value"}
    PPO.iterate(one)
    PPO.iterate(one)
    assert moved_by(one.learn_auxiliary, one.policy) == {"actor", "value", "auxiliary"}


def test_a_phase_has_so_many_rollouts_and_what_is_left_of_the_budget_has_no_auxiliary_phase():
    one = learner(budget=4 * ROLLOUT - 1)
    figures = one.iterate()
    assert one.frames == 3 * ROLLOUT and "auxiliary/policy_kl" in figures and one.phase == []
    figures = one.iterate()
    assert one.frames == 4 * ROLLOUT and "auxiliary/policy_kl" not in figures and one.phase == []


def test_the_auxiliary_phase_sees_every_step_of_the_phase_with_its_own_target():
    one = learner()
    targets, seen = [], []
    for _ in range(CONFIG.phase):
        rollout, _ = one.collect()
        seen.append(rollout.observation.clone())
        targets.append(PPO.make_batch(one, rollout)["value_target"].clone())
        one.learn(rollout)
    batch = one.auxiliary_batch()
    assert torch.equal(batch["observation"], torch.cat(seen)) and torch.equal(batch["value_target"], torch.cat(targets))
    with torch.no_grad():
        torch.testing.assert_close(batch["loc"], one.policy.actor(batch["observation"])[0])


def test_stacks_of_a_phase_are_read_as_they_are_of_a_rollout():
    config = dataclasses.replace(CONFIG, encoder="keypoints", steps_together=4, precision="fp32")
    one = after_a_policy_phase(config, observation="rgb_stack2")
    frames = torch.cat([part["observation"] for part in one.phase])
    batch = one.auxiliary_batch()
    assert batch["observation"].dtype == torch.int64
    with torch.no_grad():
        by_place, by_frame = one.policy.both(batch["observation"]), one.policy.both(frames)
    for a, b in zip(by_place, by_frame, strict=True):
        torch.testing.assert_close(a, b, atol=1e-5, rtol=1e-4)


def test_a_budget_without_a_phase_is_refused():
    with pytest.raises(ConfigError, match=r"algorithm\.phase: 3 rollouts of 128 frames are more than the budget, 383"):
        learner(budget=3 * ROLLOUT - 1)


def test_figures_of_a_phase_are_means_over_its_episodes():
    figures = [
        {"episode/count": 3.0, "episode/return": 1.0, "loss/value": 1.0},
        {"episode/count": 0.0, "loss/value": 2.0},
        {"episode/count": 1.0, "episode/return": 5.0, "loss/value": 6.0},
    ]
    assert mean_of_rollouts(figures) == {"episode/count": 4.0, "episode/return": 2.0, "loss/value": 3.0}
