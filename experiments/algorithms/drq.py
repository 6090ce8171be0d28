"""SAC on frames with random shifts (DrQ, Yarats et al. 2020), which is what the 2022 code called SAC.

Policy and critics share one CNN. Only the critics' loss trains it. A slow copy of it encodes the next observations for the
target critics. Each frame is shifted at random whenever it is sampled from the replay.
"""

from __future__ import annotations

from functools import partial

import numpy as np
import torch
from torch import Tensor, nn

from segar.experiments.algorithms.off_policy import OffPolicy
from segar.experiments.algorithms.sac import Critic, GaussianActor, SACLoss
from segar.experiments.networks.augmentations import random_shift
from segar.experiments.networks.encoders import initialize, make_encoder
from segar.experiments.networks.policies import actions_of, representation_of
from segar.experiments.settings import ConfigError, DrQConfig


class DrQPolicy(nn.Module):
    """Frames uint8 [n, height, width, depth] -> actions; the representation is the CNN's."""

    def __init__(self, config: DrQConfig, observation_shape: tuple[int, ...], actions: int) -> None:
        super().__init__()
        if len(observation_shape) != 3:
            raise ConfigError(
                f"algorithm: drq reads frames, not observations of shape {list(observation_shape)}; "
                "algorithm=sac reads vectors, observation=rgb shows frames"
            )
        self.encoder = make_encoder(config, observation_shape)
        self.actor = nn.Sequential(
            projection(config, self.encoder.width), GaussianActor(config, config.projection, actions)
        )

    def forward(self, observation: Tensor) -> tuple[Tensor, Tensor]:
        """``loc`` and ``scale`` of the pre-tanh action."""
        return self.actor(self.encoder(observation))

    def act(self, observation: np.ndarray, *, rng: torch.Generator | None) -> np.ndarray:
        """Actions float32 [n, actions]; sampled with ``rng``, deterministic where it is None."""
        return actions_of(self, observation, rng)

    def represent(self, observation: np.ndarray) -> np.ndarray:
        """The representation phi, float32 [n, width]."""
        return representation_of(self.encoder, observation)


class ProjectedCritic(nn.Module):
    """Representation [n, width] and pre-tanh actions [n, actions] -> value [n, 1]."""

    def __init__(self, config: DrQConfig, width: int, actions: int) -> None:
        super().__init__()
        self.projection = projection(config, width)
        self.critic = Critic(config, config.projection, actions)

    def forward(self, features: Tensor, u: Tensor) -> Tensor:
        """The value of the action tanh(u)."""
        return self.critic(self.projection(features), u)


class DrQ(OffPolicy):
    """The learner, see :class:`segar.experiments.algorithms.learner.Learner`."""

    make_policy = DrQPolicy

    def make_loss(self) -> SACLoss:
        """The losses of CNN, policy and two critics."""
        encoder, shift = self.policy.encoder, partial(random_shift, pixels=self.config.shift, rng=self.rng)
        critics = [ProjectedCritic(self.config, encoder.width, self.actions) for _ in range(2)]
        for network in (self.policy, *critics):
            initialize(network, self.rng)
        return SACLoss(self.config, self.policy.actor, critics, self.rng, encoder, shift).to(self.device)


def projection(config: DrQConfig, width: int) -> nn.Sequential:
    """A layer that projects a representation to ``config.projection`` numbers between -1 and 1, normalised."""
    return nn.Sequential(nn.Linear(width, config.projection), nn.LayerNorm(config.projection), nn.Tanh())
