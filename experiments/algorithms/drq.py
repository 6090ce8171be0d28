"""SAC on frames with random shifts (DrQ, Yarats et al. 2020), which is what the 2022 code called SAC.

Policy and critics share one CNN. Only the critics' loss trains it. A slow copy of it encodes the next observations for the
target critics. Each frame is shifted at random whenever it is sampled from the replay.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import torch
from tensordict import TensorDict, TensorDictBase, TensorDictParams
from tensordict.nn import TensorDictModule
from torch import Tensor, nn
from torchrl.objectives import SACLoss
from torchrl.objectives.common import LossModule

from segar.experiments.algorithms.off_policy import OffPolicy
from segar.experiments.algorithms.sac import Critic, GaussianActor, make_sac_loss
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

    @staticmethod
    def make_policy(config: DrQConfig, observation_shape: tuple[int, ...], actions: int) -> DrQPolicy:
        """The policy's network; its weights are to be drawn or loaded."""
        return DrQPolicy(config, observation_shape, actions)

    def make_loss(self) -> DrQLoss:
        """The loss over CNN, policy and two critics."""
        width = self.policy.encoder.width
        critics: list[nn.Module] = [ProjectedCritic(self.config, width, self.actions) for _ in range(2)]
        for network in (self.policy, *critics):
            initialize(network, self.rng)
            network.to(self.device)
        heads = make_sac_loss(
            self.config, self.policy.actor, critics, self.rng, actor_sees="seen", critics_see="features"
        )
        return DrQLoss(self.config, self.policy.encoder, heads, self.rng)


class DrQLoss(LossModule):
    """TorchRL's SAC loss behind one CNN.

    Args:
        heads: the loss of policy and critics. Critics read ``features``; the policy reads ``seen``, the same without gradient.
            Of the next observation, ``features`` come from the slow CNN and ``seen`` from the trained one.
        rng: draws the shifts.
    """

    heads: Any
    encoder: Any
    encoder_params: TensorDictParams
    target_encoder_params: TensorDictParams

    def __init__(self, config: DrQConfig, encoder: nn.Module, heads: SACLoss, rng: torch.Generator) -> None:
        super().__init__()
        module = TensorDictModule(encoder, in_keys=["observation"], out_keys=["features"])
        self.convert_to_functional(module, "encoder", create_target_params=True)
        self.heads, self.shift, self.rng = heads, config.shift, rng

    def forward(self, tensordict: TensorDictBase) -> TensorDict:
        """``loss_qvalue``, ``loss_actor``, ``loss_alpha``, ``alpha`` and ``entropy`` of a batch of steps."""
        batch = self.encoded(tensordict)
        loss_qvalue, _ = self.heads.qvalue_v2_loss(batch)
        as_given = batch.select("seen").set("features", batch["seen"])
        loss_actor, noted = self.heads.actor_loss(as_given)
        log_prob = noted["log_prob"]
        return TensorDict({
            "loss_qvalue": loss_qvalue,
            "loss_actor": loss_actor,
            "loss_alpha": self.heads.alpha_loss(log_prob).mean(),
            "alpha": self.heads.log_alpha.detach().exp(),
            "entropy": -log_prob.mean(),
        })  # fmt: skip

    def encoded(self, batch: TensorDictBase) -> TensorDict:
        """The batch with representations of shifted frames in place of frames."""
        now = random_shift(batch["observation"], self.shift, self.rng)
        after = random_shift(batch["next", "observation"], self.shift, self.rng)
        features = self.encode(now, self.encoder_params)
        with torch.no_grad():
            following = {
                "seen": self.encode(after, self.encoder_params),
                "features": self.encode(after, self.target_encoder_params),
                **{key: batch["next", key] for key in ("reward", "terminated", "done")},
            }
        size = batch.batch_size
        entries = {
            "features": features,
            "seen": features.detach(),
            "u": batch["u"],
            "next": TensorDict(following, size),
        }
        return TensorDict(entries, size)

    def encode(self, frames: Tensor, weights: TensorDictParams) -> Tensor:
        """Representations [n, width] by the CNN with these weights."""
        with weights.to_module(self.encoder, preserve_module_state=False):
            return self.encoder(TensorDict({"observation": frames}, [len(frames)]))["features"]


def projection(config: DrQConfig, width: int) -> nn.Sequential:
    """A layer that projects a representation to ``config.projection`` numbers between -1 and 1, normalised."""
    return nn.Sequential(nn.Linear(width, config.projection), nn.LayerNorm(config.projection), nn.Tanh())
