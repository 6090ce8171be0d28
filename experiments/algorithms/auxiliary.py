"""PPO with an auxiliary loss on its encoder: after each of PPO's updates follow gradient steps on the frames of the rollout.

A sub-class of :class:`Auxiliary` defines the loss, and how a rollout becomes batches for it.
"""

from __future__ import annotations

import copy
from abc import ABC, abstractmethod
from collections.abc import Iterator
from typing import Any, TypeVar

import torch
from tensordict import TensorDict
from torch import Tensor, nn
from torch.optim.swa_utils import get_ema_multi_avg_fn

from segar.envs import VectorEnv
from segar.experiments.algorithms.ppo import PPO
from segar.experiments.collection.collector import Rollout, action_size, observation_shape, require_frames
from segar.experiments.networks.augmentations import random_crop, random_intensity, random_shift
from segar.experiments.networks.encoders import initialize

M = TypeVar("M", bound=nn.Module)


class Auxiliary(PPO, ABC):
    """The learner, see :class:`segar.experiments.algorithms.learner.Learner`: PPO with an auxiliary loss, whose optimiser may
    be one of its own."""

    config: Any
    parts = (*PPO.parts, "loss", "own_optimizer")

    def __init__(self, config: Any, env: VectorEnv, frames: int, seed: int) -> None:
        require_frames(config.name, observation_shape(env))
        super().__init__(config, env, frames, seed)
        self.encoder: Any = self.policy.actor.encoder
        self.loss: Any = self.make_loss(action_size(env))
        known = {id(weight) for weight in self.encoder.parameters()}
        own = [weight for weight in self.loss.parameters() if weight.requires_grad and id(weight) not in known]
        self.weights, self.own_optimizer = [*self.encoder.parameters(), *own], None
        if config.auxiliary_learning_rate is None:
            self.optimizer.add_param_group({"params": own})
        else:
            self.own_optimizer = torch.optim.Adam(self.weights, lr=config.auxiliary_learning_rate, fused=True)

    @abstractmethod
    def make_loss(self, actions: int) -> CodeLoss:
        """The auxiliary loss, with freshly drawn weights; its figure ``loss`` is minimised."""

    @abstractmethod
    def batches(self, rollout: Rollout) -> Iterator[TensorDict]:
        """``auxiliary_minibatches`` batches for the loss."""

    def learn(self, rollout: Rollout) -> dict[str, float]:
        """PPO's steps, then the auxiliary ones; returns the figures of both."""
        return {**super().learn(rollout), **self.learn_auxiliary(rollout)}

    def learn_auxiliary(self, rollout: Rollout) -> dict[str, float]:
        """Takes the auxiliary gradient steps on a rollout; returns the means of the loss's figures."""
        totals, optimizer = dict[str, Tensor](), self.own_optimizer or self.optimizer
        for batch in self.batches(rollout):
            figures = self.loss(batch)
            optimizer.zero_grad()
            figures["loss"].backward()
            nn.utils.clip_grad_norm_(self.weights, self.config.max_grad_norm)
            optimizer.step()
            self.loss.follow()
            for name, value in figures.items():
                totals[name] = totals.get(name, 0.0) + value.detach()
        steps = self.config.auxiliary_minibatches
        return {f"auxiliary/{name}": float(total) / steps for name, total in totals.items()}

    def augmented(self, frames: Tensor) -> Tensor:
        """The frames [n, ...], each with random changes of its own."""
        config = self.config
        if config.crop < 1:
            frames = random_crop(frames, config.crop, self.rng)
        if config.shift > 0:
            frames = random_shift(frames, config.shift, self.rng)
        if config.intensity > 0:
            frames = random_intensity(frames, config.intensity, self.rng)
        return frames

    def with_fresh_weights(self, module: M) -> M:
        """The module with freshly drawn weights, on the policy's device."""
        initialize(module, self.rng)
        return module.to(self.device)


class CodeLoss(nn.Module):
    """A loss that compares codes of frames with those of a target network.

    Args:
        network: frames -> codes.
        tau: the share by which the targets' own weights move towards the network's; with 1 they are the network's.
    """

    def __init__(self, network: nn.Module, tau: float) -> None:
        super().__init__()
        self.network: Any = network
        self.target_network = network if tau == 1 else copy.deepcopy(network).requires_grad_(False)
        self.average: Any = get_ema_multi_avg_fn(1 - tau)

    @torch.no_grad()
    def target_codes(self, frames: Tensor) -> Tensor:
        """The codes [n, d] of frames, by the target network."""
        return self.target_network(frames)

    def follow(self) -> None:
        """Moves the targets' weights towards the network's."""
        if self.target_network is not self.network:
            self.average(list(self.target_network.parameters()), list(self.network.parameters()), None)
