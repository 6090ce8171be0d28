"""Soft actor-critic on states (Haarnoja et al. 2018b).

Critics bootstrap after every step that did not terminate its episode: the replay holds a truncated episode's last observation.
"""

import copy
import math
from collections.abc import Callable, Sequence

import numpy as np
import torch
from tensordict import TensorDictBase
from torch import Tensor, nn
from torch.nn import functional as F

from segar.experiments.algorithms.off_policy import OffPolicy
from segar.experiments.networks.encoders import MLP, initialize
from segar.experiments.networks.policies import SquashedNormal, actions_of, representation_of
from segar.experiments.settings import ConfigError, SACConfig


class GaussianActor(nn.Module):
    """Features [n, inputs] -> ``loc``, ``scale`` of the pre-tanh action, each [n, actions]."""

    def __init__(self, config: SACConfig, inputs: int, actions: int) -> None:
        super().__init__()
        self.trunk = MLP(inputs, config.widths)
        self.mean = nn.Linear(self.trunk.width, actions)
        self.log_std = nn.Linear(self.trunk.width, actions)
        self.log_std_range = (config.min_log_std, config.max_log_std)

    def forward(self, features: Tensor) -> tuple[Tensor, Tensor]:
        """``loc`` and ``scale`` of the pre-tanh action."""
        hidden = self.trunk(features)
        return self.mean(hidden), self.log_std(hidden).clamp(*self.log_std_range).exp()


class Critic(nn.Module):
    """Features [n, inputs] and pre-tanh actions [n, actions] -> value [n, 1]."""

    def __init__(self, config: SACConfig, inputs: int, actions: int) -> None:
        super().__init__()
        self.trunk = MLP(inputs + actions, config.widths)
        self.value = nn.Linear(self.trunk.width, 1)

    def forward(self, features: Tensor, u: Tensor) -> Tensor:
        """The value of the action tanh(u)."""
        return self.value(self.trunk(torch.cat([features, u.tanh()], -1)))


class SACPolicy(nn.Module):
    """State vectors -> actions; the representation is the last hidden layer."""

    def __init__(self, config: SACConfig, observation_shape: tuple[int, ...], actions: int) -> None:
        super().__init__()
        if len(observation_shape) != 1:
            raise ConfigError(
                f"algorithm: sac reads vectors, not observations of shape {list(observation_shape)}; algorithm=drq reads frames"
            )
        self.actor = GaussianActor(config, observation_shape[0], actions)

    def forward(self, observation: Tensor) -> tuple[Tensor, Tensor]:
        """``loc`` and ``scale`` of the pre-tanh action."""
        return self.actor(observation)

    def act(self, observation: np.ndarray, *, rng: torch.Generator | None) -> np.ndarray:
        """Actions float32 [n, actions]; sampled with ``rng``, deterministic where it is None."""
        return actions_of(self, observation, rng)

    def represent(self, observation: np.ndarray) -> np.ndarray:
        """The representation phi, float32 [n, width]."""
        return representation_of(self.actor.trunk, observation)


class SACLoss(nn.Module):
    """The losses of a policy, of critics with slow copies as their targets, and of the temperature.

    TorchRL's, of the same definition, take a third longer on small networks.

    Args:
        actor: features -> ``loc``, ``scale``.
        critics: features and ``u`` -> value [n, 1]; of one architecture, with weights of their own.
        rng: draws the actions that the losses evaluate.
        encoder: observations -> features; of the losses, only that of the critics trains it. Its slow copy encodes the next
            observations for the target critics.
        augment: what is done to observations first.
    """

    def __init__(
        self,
        config: SACConfig,
        actor: nn.Module,
        critics: Sequence[nn.Module],
        rng: torch.Generator,
        encoder: nn.Module | None = None,
        augment: Callable[[Tensor], Tensor] = lambda observation: observation,
    ) -> None:
        super().__init__()
        self.config, self.rng, self.augment = config, rng, augment
        self.encoder = encoder or nn.Identity()
        self.actor, self.critics = actor, nn.ModuleList(critics)
        self.critics_weights = tuple(self.critics.parameters())
        self.log_alpha = nn.Parameter(torch.tensor(math.log(config.temperature)))
        self.target_encoder = copy.deepcopy(self.encoder).requires_grad_(False)
        self.target_critics = copy.deepcopy(self.critics).requires_grad_(False)

    def forward(self, batch: TensorDictBase) -> dict[str, Tensor]:
        """``loss_qvalue``, ``loss_actor``, ``loss_alpha``, ``alpha`` and ``entropy`` of a batch of steps [n], with
        ``observation``, ``u`` and, under ``next``, ``observation``, ``reward`` and ``terminated`` [n, 1]."""
        now, following = self.augment(batch["observation"]), self.augment(batch["next", "observation"])
        features, alpha = self.encoder(now), self.log_alpha.detach().exp()
        with torch.no_grad():
            u, log_prob = self.draw(self.encoder(following))
            value = smallest(self.target_critics, self.target_encoder(following), u) - alpha * log_prob
            target = batch["next", "reward"] + self.config.gamma * ~batch["next", "terminated"] * value
        loss_qvalue = torch.stack([F.mse_loss(one(features, batch["u"]), target) for one in self.critics]).sum()
        features = features.detach()
        u, log_prob = self.draw(features)
        for weight in self.critics_weights:  # what is recorded from here on computes no gradients of them
            weight.requires_grad_(False)
        loss_actor = (alpha * log_prob - smallest(self.critics, features, u)).mean()
        for weight in self.critics_weights:
            weight.requires_grad_(True)
        surprise = log_prob.detach().mean()
        return {
            "loss_qvalue": loss_qvalue,
            "loss_actor": loss_actor,
            "loss_alpha": -self.log_alpha * (surprise + self.config.target_entropy),
            "alpha": alpha,
            "entropy": -surprise,
        }

    def draw(self, features: Tensor) -> tuple[Tensor, Tensor]:
        """Actions of the policy: ``u`` [n, actions], and the log-density of ``tanh(u)``, [n, 1]."""
        loc, scale = self.actor(features)
        u = loc + scale * torch.randn(loc.shape, generator=self.rng).to(loc.device)
        return u, SquashedNormal(loc, scale).log_prob(u)[:, None]


def smallest(critics: nn.ModuleList, features: Tensor, u: Tensor) -> Tensor:
    """The smallest of the critics' values of ``tanh(u)``, [n, 1]."""
    return torch.stack([critic(features, u) for critic in critics]).amin(0)


class SAC(OffPolicy):
    """The learner, see :class:`segar.experiments.algorithms.learner.Learner`."""

    make_policy = SACPolicy

    def make_loss(self) -> SACLoss:
        """The losses of the policy and two critics."""
        critics = [Critic(self.config, self.shape[0], self.actions) for _ in range(2)]
        for network in (self.policy, *critics):
            initialize(network, self.rng)
        return SACLoss(self.config, self.policy.actor, critics, self.rng).to(self.device)
