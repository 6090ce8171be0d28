"""What an agent computes with: encoders, heads, and the tanh-Gaussian policy over pre-tanh actions."""

from __future__ import annotations

import math
from functools import cache
from itertools import pairwise
from typing import ClassVar

import numpy as np
import torch
from torch import Tensor, nn
from torch.distributions import Independent, Normal
from torch.distributions import constraints as torch_constraints
from torch.nn import functional as F

from experiments.config import PPOConfig
from experiments.errors import ConfigError

# Gauss-Hermite nodes: enough for the entropy of a squashed Gaussian to 1e-4 nats up to a standard deviation of 2.
QUADRATURE_NODES = 12


class SquashedNormal(Independent):
    """The law of ``tanh(u)`` with ``u ~ N(loc, scale²)`` per dimension, addressed by ``u``.

    ``log_prob(u)`` is the log-density of the action ``tanh(u)``. Nothing is ever inverted, so saturated actions
    (``tanh(u) = ±1`` in float32) stay exact. ``loc`` and ``scale``: float ``[..., d]``.
    """

    arg_constraints: ClassVar = {"loc": torch_constraints.real, "scale": torch_constraints.positive}

    def __init__(self, loc: Tensor, scale: Tensor) -> None:
        super().__init__(Normal(loc, scale, validate_args=False), 1, validate_args=False)

    def log_prob(self, value: Tensor) -> Tensor:
        """Log-density of ``tanh(value)``, ``[...]``."""
        return super().log_prob(value) - log_slope(value).sum(-1)

    def entropy(self) -> Tensor:
        """Differential entropy of ``tanh(u)``, ``[...]``, by quadrature: H[u] + E[log (1 - tanh² u)]."""
        nodes, weights = _hermite(self.base_dist.loc.dtype)
        u = self.base_dist.loc[..., None] + self.base_dist.scale[..., None] * nodes
        return super().entropy() + (log_slope(u) * weights).sum((-1, -2))

    @property
    def deterministic_sample(self) -> Tensor:
        """The pre-tanh action of the policy without noise."""
        return self.base_dist.loc


def log_slope(u: Tensor) -> Tensor:
    """log (1 - tanh² u), without cancellation for large |u|."""
    return 2.0 * (math.log(2.0) - u - F.softplus(-2.0 * u))


@cache
def _hermite(dtype: torch.dtype) -> tuple[Tensor, Tensor]:
    nodes, weights = np.polynomial.hermite_e.hermegauss(QUADRATURE_NODES)
    return torch.as_tensor(nodes, dtype=dtype), torch.as_tensor(weights / weights.sum(), dtype=dtype)


class MLP(nn.Module):
    """State vector [n, d] -> representation [n, widths[-1]]: dense layers with ReLU (or tanh) after each."""

    def __init__(self, inputs: int, widths: tuple[int, ...], activation: type[nn.Module] = nn.ReLU) -> None:
        super().__init__()
        sizes = (inputs, *widths)
        layers = [m for a, b in pairwise(sizes) for m in (nn.Linear(a, b), activation())]
        self.layers = nn.Sequential(*layers)
        self.width = widths[-1]

    def forward(self, observation: Tensor) -> Tensor:
        return self.layers(observation)


class Impala(nn.Module):
    """Pixels uint8 [n, height, width, depth] -> representation [n, 256]: IMPALA's residual CNN, channels 16, 32, 32.

    Each block: 3x3 convolution, 3x3 max-pool of stride 2, two residual units (Espeholt et al. 2018).
    """

    width = 256

    def __init__(self, height: int, width: int, depth: int = 3, channels: tuple[int, ...] = (16, 32, 32)) -> None:
        super().__init__()
        sizes = (depth, *channels)
        self.blocks = nn.Sequential(*(_ImpalaBlock(a, b) for a, b in pairwise(sizes)))
        for _ in channels:
            height, width = (height + 1) // 2, (width + 1) // 2
        self.dense = nn.Linear(channels[-1] * height * width, self.width)
        self.to(memory_format=torch.channels_last)  # type: ignore[call-overload]

    def forward(self, pixels: Tensor) -> Tensor:
        x = pixels.permute(0, 3, 1, 2).float() / 255.0  # a view: channels are last in memory already
        x = F.relu(self.blocks(x)).flatten(1)
        return F.relu(self.dense(x))


class _ImpalaBlock(nn.Module):
    def __init__(self, inputs: int, outputs: int) -> None:
        super().__init__()
        self.entry = nn.Conv2d(inputs, outputs, 3, padding=1)
        self.residuals = nn.ModuleList(
            nn.Sequential(
                nn.ReLU(),
                nn.Conv2d(outputs, outputs, 3, padding=1),
                nn.ReLU(),
                nn.Conv2d(outputs, outputs, 3, padding=1),
            )
            for _ in range(2)
        )

    def forward(self, x: Tensor) -> Tensor:
        x = F.max_pool2d(self.entry(x), 3, stride=2, padding=1)
        for residual in self.residuals:
            x = x + residual(x)
        return x


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


def make_encoder(config: PPOConfig, observation_shape: tuple[int, ...]) -> MLP | Impala:
    """The encoder that the configuration asks for, or that the observation's shape calls for.

    Raises:
        ConfigError: it cannot read observations of that shape.
    """
    fitting = {3: "impala", 1: "mlp"}.get(len(observation_shape))
    if fitting is None or config.encoder not in ("auto", fitting):
        fix = f"choose {fitting} or auto" if fitting else "states are vectors, pixels [height, width, 3]"
        raise ConfigError(
            f"algorithm.encoder: '{config.encoder}' cannot read observations of shape {observation_shape}; {fix}"
        )
    if fitting == "impala":
        return Impala(*observation_shape)
    return MLP(observation_shape[0], config.widths)


def make_head(config: PPOConfig, inputs: int, outputs: int) -> nn.Sequential:
    """Representation -> outputs, through one hidden tanh layer or straight."""
    if config.head_width == 0:
        return nn.Sequential(nn.Linear(inputs, outputs))
    return nn.Sequential(nn.Linear(inputs, config.head_width), nn.Tanh(), nn.Linear(config.head_width, outputs))


def initialize(module: nn.Module, rng: torch.Generator) -> None:
    """Glorot-uniform weights and zero biases for every dense and convolutional layer, drawn from ``rng``."""
    for layer in module.modules():
        if isinstance(layer, nn.Linear | nn.Conv2d):
            nn.init.xavier_uniform_(layer.weight, generator=rng)
            if layer.bias is not None:
                nn.init.zeros_(layer.bias)
