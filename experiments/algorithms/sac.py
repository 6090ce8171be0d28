"""Soft actor-critic on states (Haarnoja et al. 2018b): TorchRL's loss and target networks, our replay and loop.

Critics bootstrap after every step that did not terminate its episode: the replay holds a truncated episode's last observation.
"""

from typing import Any

import numpy as np
import torch
from tensordict.nn import ProbabilisticTensorDictModule, ProbabilisticTensorDictSequential, TensorDictModule
from torch import Tensor, nn
from torchrl.objectives import SACLoss

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


class SAC(OffPolicy):
    """The learner, see :class:`segar.experiments.algorithms.learner.Learner`."""

    @staticmethod
    def make_policy(config: SACConfig, observation_shape: tuple[int, ...], actions: int) -> SACPolicy:
        """The policy's network; its weights are to be drawn or loaded."""
        return SACPolicy(config, observation_shape, actions)

    def make_loss(self) -> SACLoss:
        """TorchRL's loss, over the policy and two critics."""
        critics: list[nn.Module] = [Critic(self.config, self.shape[0], self.actions) for _ in range(2)]
        for network in (self.policy, *critics):
            initialize(network, self.rng)
            network.to(self.device)
        return make_sac_loss(self.config, self.policy.actor, critics, self.rng)


def make_sac_loss(
    config: SACConfig,
    actor: nn.Module,
    critics: list[nn.Module],
    rng: torch.Generator,
    actor_sees: str = "observation",
    critics_see: str = "observation",
) -> SACLoss:
    """TorchRL's loss on batches with the actor's and the critics' inputs, ``u``, and under ``next`` the inputs, reward and end.

    Args:
        actor: maps its input to ``loc`` and ``scale``.
        critics: each maps its input and ``u`` to a value; of one architecture, with weights of their own.
        rng: draws the actions that the losses evaluate.
        actor_sees, critics_see: names of the inputs in a batch.
    """
    parts: list[Any] = [
        TensorDictModule(actor, in_keys=[actor_sees], out_keys=["loc", "scale"]),
        ProbabilisticTensorDictModule(
            in_keys=["loc", "scale"], out_keys=["u"], distribution_class=_drawing_from(rng), return_log_prob=True
        ),
    ]
    loss = SACLoss(
        ProbabilisticTensorDictSequential(*parts),
        [TensorDictModule(one, in_keys=[critics_see, "u"], out_keys=["state_action_value"]) for one in critics],
        num_qvalue_nets=len(critics),
        loss_function="l2",
        alpha_init=config.temperature,
        target_entropy=config.target_entropy,
    )
    loss.make_value_estimator(gamma=config.gamma)
    _ = loss.target_entropy  # which TorchRL makes a buffer now; a loss without it cannot load a state that has it
    return loss


class _SeededNormal(SquashedNormal):
    """A squashed Gaussian that draws from a generator of its own instead of torch's global one."""

    def __init__(self, loc: Tensor, scale: Tensor, rng: torch.Generator) -> None:
        super().__init__(loc, scale)
        self.rng = rng

    def rsample(self, sample_shape: Any = ()) -> Tensor:
        noise = torch.randn((*sample_shape, *self.base_dist.loc.shape), generator=self.rng)
        return self.base_dist.loc + self.base_dist.scale * noise.to(self.base_dist.loc.device)


def _drawing_from(rng: torch.Generator) -> Any:
    return lambda loc, scale: _SeededNormal(loc, scale, rng)
