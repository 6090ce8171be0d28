"""Rewards as the learner sees them; returns and evaluations always count the task's own rewards."""

import numpy as np
import torch
from torch import Tensor

from segar.experiments.collection.saved_state import SavedState
from segar.experiments.commands.kernels import are_portable
from segar.experiments.settings import OffPolicyConfig, PPOConfig

LARGEST = 10.0  # normalised rewards are clipped to this, as in OpenAI's baselines
TAIL = 0.25  # slope of the root transform beyond 1: a death of -100 is seen as -25.75


def learner_reward(config: PPOConfig | OffPolicyConfig, reward: Tensor) -> Tensor:
    """The reward that the learner sees, of any shape: the task's, transformed, and then times ``reward_scale``.

    ``reward_transform`` is 'none', or 'sqrt': sign(r) |r|^1/2 for |r| up to 1, and straight on with a slope of :data:`TAIL`
    beyond.
    """
    if config.reward_transform == "sqrt":
        # Near the goal -d^2 is almost flat, and its root is not. The root of a death of -100 is only -10, which an agent that
        # looks ten steps ahead prefers to staying away from the goal; the death itself would dominate the loss.
        size = reward.abs()
        # Torch's own root is off in the last bit, by another amount on another processor; numpy's is exact.
        root = torch.from_numpy(np.sqrt(size.numpy())) if are_portable() else size.sqrt()
        reward = reward.sign() * torch.where(size > 1.0, 1.0 + TAIL * (size - 1.0), root)
    return reward * config.reward_scale


class ReturnScale(SavedState):
    """Divides rewards by the standard deviation of the discounted returns so far, as Procgen's baselines do.

    Args:
        num_envs: environments, whose rewards come in parallel.
        gamma: the discount.
    """

    saved = ("returns", "count", "mean", "squares")

    def __init__(self, num_envs: int, gamma: float) -> None:
        self.gamma = gamma
        self.returns = torch.zeros(num_envs, 1, dtype=torch.float64)  # of the running episodes until now, discounted
        self.count, self.mean, self.squares = 0, 0.0, 0.0  # of all returns at all steps; Welford's sums

    def __call__(self, reward: Tensor, done: Tensor) -> Tensor:
        """Scaled rewards, of the shape and dtype of ``reward`` [T, N, 1]; ``done`` says where episodes end."""
        seen = []
        for now, ends in zip(reward.double().cpu(), done.cpu(), strict=True):
            self.returns = self.returns * self.gamma + now
            seen.append(self.returns)
            self.returns = self.returns.masked_fill(ends, 0.0)
        self._count(torch.stack(seen))
        return self.scaled(reward)

    def scaled(self, reward: Tensor) -> Tensor:
        """Rewards in the present scale, of which the scale takes no note."""
        if self.count == 0:
            return reward
        return (reward / max(self.squares / self.count, 1e-8) ** 0.5).clamp(-LARGEST, LARGEST)

    def _count(self, values: Tensor) -> None:
        new, mean = values.numel(), float(values.mean())
        total, shift = self.count + new, mean - self.mean
        self.squares += float((values - mean).square().sum()) + shift**2 * self.count * new / total
        self.mean += shift * new / total
        self.count = total
