"""DrAC and UCB-DrAC (Raileanu et al. 2021, "Automatic data augmentation for generalization in reinforcement learning") on PPO.

Policy and value are kept the same when a frame s is changed to f(s). What PPO minimises gets two further terms:

    alpha_r (G_pi + G_V),   G_pi = KL[pi(. | s) || pi(. | f(s))],   G_V = (V(s) - V(f(s)))^2 / 2

What the networks say of s is held fixed in both, so that only what they say of f(s) is moved. The KL of the Gaussians before
tanh, which is that of the actions, is computed exactly; the authors' code estimates it from one action, with equal gradients
on average. The half in G_V is their code's.

Where there are several augmentations, each update uses the one of the highest upper confidence bound

    Q(f) + c sqrt(log t / N(f))

with Q(f) the mean return of the last K rollouts that were collected right after an update with f, N(f) the number of such
updates, and t that of all. Each is tried once first. (In the authors' code, untried ones have Q = 0 and N = 1.) A rollout's
return is the mean of the value targets of its steps, in the units of the rewards that the learner sees.
"""

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import Any, ClassVar

import torch
from tensordict import TensorDict
from torch import Tensor, nn
from torch.distributions import kl_divergence

from segar.envs import VectorEnv
from segar.experiments.algorithms.ppo import LOGGED, PPO, clipped_loss
from segar.experiments.collection.collector import Rollout, observation_shape, require_frames
from segar.experiments.collection.saved_state import SavedState
from segar.experiments.networks.augmentations import (
    greyscale,
    random_colour_jitter,
    random_convolution,
    random_cutout,
    random_flip,
    random_rotation,
    random_shift,
)
from segar.experiments.networks.policies import SquashedNormal
from segar.experiments.settings import DrACConfig

CACHED = 64  # frames that are changed together: so many stay in a processor's cache, which takes half the time
Augmentation = Callable[[Tensor, DrACConfig, torch.Generator], Tensor]

AUGMENTATIONS: Mapping[str, Augmentation] = {
    "crop": lambda frames, config, rng: random_shift(frames, config.shift, rng),
    "greyscale": lambda frames, config, rng: greyscale(frames),
    "cutout": lambda frames, config, rng: random_cutout(frames, False, rng),
    "cutout_colour": lambda frames, config, rng: random_cutout(frames, True, rng),
    "random_conv": lambda frames, config, rng: random_convolution(frames, rng),
    "colour_jitter": lambda frames, config, rng: random_colour_jitter(frames, rng),
    "flip": lambda frames, config, rng: random_flip(frames, rng),
    "rotate": lambda frames, config, rng: random_rotation(frames, rng),
}


class DrAC(PPO):
    """The learner, see :class:`segar.experiments.algorithms.learner.Learner`."""

    config: DrACConfig
    parts = (*PPO.parts, "choice")
    logged: ClassVar[Mapping[str, str]] = {
        **LOGGED,
        "loss_policy_change": "loss/policy_change",
        "loss_value_change": "loss/value_change",
    }

    def __init__(self, config: DrACConfig, env: VectorEnv, frames: int, seed: int) -> None:
        require_frames(config.name, observation_shape(env))
        super().__init__(config, env, frames, seed)
        # A rollout that was collected ahead comes from the weights before the last update.
        lag = 2 if config.overlap else 1
        self.choice = UpperConfidenceBound(config.augmentations, config.ucb_exploration, config.ucb_window, lag)

    def learn(self, rollout: Rollout) -> dict[str, float]:
        """PPO's steps with both terms, under one augmentation; returns the figures, and which augmentation it was."""
        figures = super().learn(rollout)
        names = self.config.augmentations
        chosen = {f"augmentation/{name}": float(name == self.choice.last) for name in names} if len(names) > 1 else {}
        return {**figures, **chosen}

    def make_batch(self, rollout: Rollout) -> TensorDict:
        """PPO's batch, with frames to be augmented. Its mean return is what an earlier augmentation is judged by, before the
        next one is chosen."""
        batch = super().make_batch(rollout)
        if batch["observation"] is not rollout.observation:  # the encoder reads them in a form of its own
            batch["frames"] = rollout.observation
        self.choice.judge(float(batch["value_target"].mean()))
        self.choice.choose()
        return batch

    def minibatches(self, batch: TensorDict) -> Iterator[TensorDict]:
        """PPO's minibatches, ``steps``, each with the first of its frames, whose order is random, ``augmented``."""
        augment = AUGMENTATIONS[self.choice.last]
        for steps in super().minibatches(batch):
            frames = steps.pop("frames", steps["observation"])
            frames = frames[: math.ceil(self.config.augmented_share * len(frames))]
            parts = frames.split(CACHED if frames.device.type == "cpu" else len(frames))
            augmented = torch.cat([augment(part, self.config, self.rng) for part in parts])
            yield TensorDict({"steps": steps, "augmented": augmented})

    def losses(self, minibatch: TensorDict) -> dict[str, Tensor]:
        """The figures of PPO's loss, and both terms."""
        parts: Any = minibatch
        steps, augmented = parts["steps"], parts["augmented"]
        found = self.policy(steps["observation"])
        changes = changes_under(self.policy, augmented, *(part[: len(augmented)] for part in found))
        return clipped_loss(self.config, steps, *found) | {
            name: self.config.invariance_coef * change
            for name, change in zip(("loss_policy_change", "loss_value_change"), changes, strict=True)
        }


def changes_under(
    policy: nn.Module, augmented: Tensor, loc: Tensor, scale: Tensor, value: Tensor
) -> tuple[Tensor, Tensor]:
    """G_pi [nats] and G_V: how far policy and value at augmented frames are from ``loc``, ``scale`` and ``value``; means over
    frames. These three are held fixed."""
    there = policy(augmented)
    fixed = SquashedNormal(loc.detach(), scale.detach())
    policy_change = kl_divergence(fixed, SquashedNormal(*there[:2])).mean()
    return policy_change, 0.5 * (value.detach() - there[2]).square().mean()


class UpperConfidenceBound(SavedState):
    """Chooses one of several arms again and again, by the rewards that followed the last choices of each.

    Args:
        arms: their names.
        exploration: c, the weight of what is not known of an arm.
        window: K, the last rewards of an arm that count.
        lag: how many choices are made until the reward of the first one is known.
    """

    saved = ("counts", "rewards", "waiting")

    def __init__(self, arms: Sequence[str], exploration: float, window: int, lag: int = 1) -> None:
        self.arms, self.exploration, self.window, self.lag = tuple(arms), exploration, window, lag
        self.counts = [0] * len(self.arms)
        self.rewards: list[list[float]] = [[] for _ in self.arms]  # the last ones of each
        self.waiting: list[int] = []  # choices whose reward is not known yet, the oldest first

    @property
    def last(self) -> str:
        """The arm that was chosen last."""
        return self.arms[self.waiting[-1]]

    def choose(self) -> str:
        """The arm with the highest bound; the first of those that were never chosen, if there are any."""
        bounds = [self.bound(arm) for arm in range(len(self.arms))]
        chosen = bounds.index(max(bounds))
        self.counts[chosen] += 1
        self.waiting.append(chosen)
        return self.arms[chosen]

    def bound(self, arm: int) -> float:
        """The upper confidence bound of an arm; infinite where nothing is known of it and it was not chosen."""
        rewards, count = self.rewards[arm], self.counts[arm]
        if count == 0:
            return math.inf
        if not rewards:  # chosen, and not judged yet
            return -math.inf
        return sum(rewards) / len(rewards) + self.exploration * math.sqrt(math.log(sum(self.counts)) / count)

    def judge(self, reward: float) -> None:
        """Says what followed the oldest choice that waits for its reward; nothing where there are fewer than ``lag``."""
        if len(self.waiting) >= self.lag:
            rewards = self.rewards[self.waiting.pop(0)]
            rewards.append(reward)
            del rewards[: -self.window]
