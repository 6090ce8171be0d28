"""DrAC: its two terms by hand, whom their gradient reaches, what they do to a policy, and which augmentation is chosen."""

import dataclasses

import numpy as np
import pytest
import torch

from segar import family
from segar.experiments.algorithms.drac import AUGMENTATIONS, DrAC, UpperConfidenceBound, changes_under
from segar.experiments.algorithms.ppo import PPO
from segar.experiments.settings.algorithms import AUGMENTATIONS as NAMES
from segar.experiments.settings.algorithms import DrACConfig, PPOConfig

LEVELS = family("objectsx1-easy").sample(5, seed=0)
SMALL = {
    "num_envs": 4,
    "num_steps": 16,
    "encoder": "small",
    "minibatches": 2,
    "precision": "fp32",
    "learning_rate": 1e-3,
}
CONFIG = DrACConfig(**SMALL, augmentations=("crop",), shift=4)


def learner(config=CONFIG, seed=0, kind=DrAC, observation="rgb"):
    return kind(config, kind.make_env(LEVELS, config.num_envs, seed=seed, observation=observation), 10_000, seed)


def minibatch_of(one):
    rollout, _ = one.collect()
    return next(one.minibatches(one.make_batch(rollout)))


def test_every_augmentation_that_settings_know_exists():
    assert set(NAMES) == set(AUGMENTATIONS)


def test_the_terms_are_the_divergence_of_gaussians_and_half_the_squared_difference_of_values():
    one = learner()
    minibatch = minibatch_of(one)
    with torch.no_grad():
        here, there = (one.policy(minibatch[name]) for name in (("steps", "observation"), "augmented"))
        found = changes_under(one.policy, minibatch["augmented"], *here)
    (m, s, v), (m2, s2, v2) = ([part.double().numpy() for part in side] for side in (here, there))
    divergence = np.log(s2 / s) + (s**2 + (m - m2) ** 2) / (2 * s2**2) - 0.5
    assert found[0].item() == pytest.approx(divergence.sum(-1).mean(), rel=1e-3)
    assert found[1].item() == pytest.approx(0.5 * ((v - v2) ** 2).mean(), rel=1e-3)
    assert divergence.sum(-1).mean() > 0


def test_the_gradient_of_the_terms_passes_through_augmented_frames_alone():
    one = learner()
    minibatch = minibatch_of(one)
    here = one.policy(minibatch["steps", "observation"])
    for value in here:
        value.retain_grad()
    sum(changes_under(one.policy, minibatch["augmented"], *here)).backward()  # type: ignore[union-attr]
    assert all(value.grad is None for value in here)
    assert all(weight.grad is not None and weight.grad.any() for weight in one.policy.parameters() if weight.dim() > 1)


def test_without_the_terms_the_loss_and_its_gradient_are_those_of_ppo():
    one, plain = learner(dataclasses.replace(CONFIG, invariance_coef=0.0)), learner(PPOConfig(**SMALL), kind=PPO)
    minibatch, same = minibatch_of(one), minibatch_of(plain)
    assert torch.equal(minibatch["steps", "observation"], same["observation"])
    figures, expected = one.losses(minibatch), plain.losses(same)
    assert figures["loss_policy_change"] == figures["loss_value_change"] == 0
    for name in expected.keys():
        torch.testing.assert_close(figures[name], expected[name])
    for policy, found in ((one.policy, figures), (plain.policy, expected)):
        sum(value for name, value in found.items() if name.startswith("loss_")).backward()
        assert all(weight.grad is not None for weight in policy.parameters())
    for a, b in zip(one.policy.parameters(), plain.policy.parameters(), strict=True):
        torch.testing.assert_close(a.grad, b.grad)


def test_stacks_are_augmented_as_frames_also_where_the_encoder_reads_places_in_a_pool():
    config = dataclasses.replace(CONFIG, encoder="keypoints", steps_together=4)
    one = learner(config, observation="rgb_stack2")
    minibatch = minibatch_of(one)
    assert minibatch["steps", "observation"].dtype == torch.int64
    assert minibatch["augmented"].shape == (32, 64, 64, 6) and minibatch["augmented"].dtype == torch.uint8
    assert "frames" not in minibatch["steps"].keys()


def test_changes_are_measured_on_a_share_of_each_minibatch():
    one = learner(dataclasses.replace(CONFIG, augmented_share=0.25))
    minibatch = minibatch_of(one)
    assert len(minibatch["steps"]) == 32 and len(minibatch["augmented"]) == 8
    with torch.no_grad():
        here = [part[:8] for part in one.policy(minibatch["steps", "observation"])]
        expected = changes_under(one.policy, minibatch["augmented"], *here)
        figures = one.losses(minibatch)
    torch.testing.assert_close(figures["loss_policy_change"], 0.1 * expected[0])
    torch.testing.assert_close(figures["loss_value_change"], 0.1 * expected[1])


def test_the_bound_is_that_of_its_definition():
    rng = np.random.default_rng(0)
    choice = UpperConfidenceBound("abc", exploration=0.7, window=3)
    history: list[tuple[str, float]] = []
    for t in range(40):
        if t < 3:
            expected = "abc"[t]
        else:
            bounds = {}
            for arm in "abc":
                rewards = [reward for chosen, reward in history if chosen == arm]
                bounds[arm] = np.mean(rewards[-3:]) + 0.7 * np.sqrt(np.log(t) / len(rewards))
            expected = max(bounds, key=bounds.__getitem__)
        assert choice.choose() == expected == choice.last
        history.append((expected, rng.normal()))
        choice.judge(history[-1][1])


def test_a_choice_is_judged_by_the_rollout_that_its_weights_collect():
    choice = UpperConfidenceBound("ab", exploration=0.0, window=5, lag=2)
    for reward in (1.0, 2.0, 3.0, 4.0):  # a rollout, and then an update
        choice.judge(reward)
        choice.choose()
    # The first two rollouts were collected before the first update could matter.
    assert [list(rewards) for rewards in choice.rewards] == [[3.0], [4.0]]


def test_the_mean_value_target_of_the_next_rollout_judges_an_augmentation():
    one = learner(dataclasses.replace(CONFIG, augmentations=("crop", "cutout")))
    first, _ = one.collect()
    figures = one.learn(first)
    assert figures["augmentation/crop"] == 1.0 and figures["augmentation/cutout"] == 0.0
    second, _ = one.collect()
    expected = PPO.make_batch(one, second)["value_target"].mean().item()
    assert one.learn(second)["augmentation/cutout"] == 1.0
    assert [list(rewards) for rewards in one.choice.rewards] == [[expected], []]
