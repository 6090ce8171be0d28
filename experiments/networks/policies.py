"""From representations to actions: heads, and the tanh-Gaussian distribution over pre-tanh actions."""

import math
from functools import cache

import numpy as np
import torch
from torch import Tensor, nn
from torch.distributions import Independent, Normal
from torch.nn import functional as F

from segar.experiments.networks.encoders import make_encoder
from segar.experiments.settings import PPOConfig

# Gauss-Hermite nodes: enough for the entropy of a squashed Gaussian to 1e-4 nats up to a standard deviation of 2.
QUADRATURE_NODES = 12


class SquashedNormal(Independent):
    """The distribution of ``tanh(u)`` with ``u ~ N(loc, scale²)`` per dimension, addressed by ``u``.

    ``log_prob(u)`` is the log-density of the action ``tanh(u)``. Nothing is ever inverted, so saturated actions
    (``tanh(u) = ±1`` in float32) stay exact. ``loc`` and ``scale``: float ``[..., d]``.
    """

    def __init__(self, loc: Tensor, scale: Tensor) -> None:
        super().__init__(Normal(loc, scale, validate_args=False), 1, validate_args=False)

    def log_prob(self, value: Tensor) -> Tensor:
        """Log-density of ``tanh(value)``, ``[...]``."""
        return super().log_prob(value) - log_slope(value).sum(-1)

    def entropy(self) -> Tensor:
        """Differential entropy of ``tanh(u)``, ``[...]``, by quadrature: H[u] + E[log (1 - tanh² u)]."""
        nodes, weights = _hermite(self.base_dist.loc.dtype, self.base_dist.loc.device)
        u = self.base_dist.loc[..., None] + self.base_dist.scale[..., None] * nodes
        return super().entropy() + (log_slope(u) * weights).sum((-1, -2))


def log_slope(u: Tensor) -> Tensor:
    """log (1 - tanh² u), without cancellation for large |u|."""
    return 2.0 * (math.log(2.0) - u - F.softplus(-2.0 * u))


@torch.compiler.assume_constant_result  # NumPy cannot be traced
def _hermite(dtype: torch.dtype, device: torch.device) -> tuple[Tensor, Tensor]:
    return _made_hermite(dtype, device)


@cache
def _made_hermite(dtype: torch.dtype, device: torch.device) -> tuple[Tensor, Tensor]:
    nodes, weights = np.polynomial.hermite_e.hermegauss(QUADRATURE_NODES)
    return (
        torch.as_tensor(nodes, dtype=dtype, device=device),
        torch.as_tensor(weights / weights.sum(), dtype=dtype, device=device),
    )


class Actor(nn.Module):
    """Observation -> ``loc``, ``scale`` of the policy (each [n, actions]) and the representation phi [n, width]."""

    def __init__(self, config: PPOConfig, observation_shape: tuple[int, ...], actions: int) -> None:
        super().__init__()
        self.encoder = make_encoder(config, observation_shape)
        self.mean = make_head(config, self.encoder.width, actions)
        self.log_std = make_head(config, self.encoder.width, actions)
        self.log_std_range = (config.min_log_std, config.max_log_std)

    def forward(self, observation: Tensor) -> tuple[Tensor, Tensor, Tensor]:
        hidden = self.encoder(observation)
        return self.mean(hidden), self.log_std(hidden).clamp(*self.log_std_range).exp(), hidden


@torch.no_grad()
def actions_of(network: nn.Module, observation: np.ndarray, rng: torch.Generator | None) -> np.ndarray:
    """Actions float32 [n, actions] by a network that returns ``loc`` and ``scale`` first.

    They are sampled with ``rng``, a generator of the CPU, and deterministic where it is None.
    """
    loc, scale, *_ = network(_on_device_of(network, observation))
    return squashed_actions(loc, scale, rng)


def squashed_actions(loc: Tensor, scale: Tensor, rng: torch.Generator | None) -> np.ndarray:
    """Actions float32 [n, actions] between -1 and 1; sampled with ``rng``, deterministic where it is None."""
    u = loc if rng is None else loc + scale * torch.randn(loc.shape, generator=rng).to(loc.device)
    return u.tanh().cpu().numpy()


@torch.no_grad()
def representation_of(encoder: nn.Module, observation: np.ndarray) -> np.ndarray:
    """The encoder's output, float32 [n, width]."""
    return encoder(_on_device_of(encoder, observation)).cpu().numpy()


def _on_device_of(module: nn.Module, observation: np.ndarray) -> Tensor:
    return torch.from_numpy(observation).to(next(module.parameters()).device)


def make_head(config: PPOConfig, inputs: int, outputs: int) -> nn.Sequential:
    """Representation -> outputs, through one hidden tanh layer or straight."""
    if config.head_width == 0:
        return nn.Sequential(nn.Linear(inputs, outputs))
    return nn.Sequential(nn.Linear(inputs, config.head_width), nn.Tanh(), nn.Linear(config.head_width, outputs))
