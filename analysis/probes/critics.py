"""Critics: functions T(x, z) that learn to tell pairs that belong together from pairs that do not."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import torch
from torch import Tensor, nn
from torch.nn import functional as F

from segar.errors import SegarError

CHUNK = 1024  # rows whose scores with all others are held at once


@dataclass(frozen=True)
class CriticSettings:
    """The critic that compares embeddings, and how it learns; chosen so that z = phi is told apart from 1 to 16 numbers."""

    steps: int = 300
    batch: int = 128
    learning_rate: float = 1e-2  # falls to 0 along a cosine
    width: int = 64
    embedding: int = 16


@dataclass(frozen=True)
class PaperSettings:
    """The critic of the 2022 code, and how it learnt: a dense layer on phi and z in one row."""

    epochs: int = 15
    batch: int = 64  # what is left over at the end of an epoch is dropped
    learning_rate: float = 3e-4
    width: int = 512
    dropout: float = 0.1


class DistanceCritic(nn.Module):
    """T(x_i, z_j) = a(x_i) + b(z_j) - s |f(x_i) - g(z_j)|² for all i and j at once, all four by networks of two layers.

    A layer on the concatenation of x and z, as in the 2022 code, takes many more samples to see that 8 numbers agree.
    """

    def __init__(self, x_size: int, z_size: int, settings: CriticSettings) -> None:
        super().__init__()
        width, size = settings.width, settings.embedding
        self.f, self.g = Embedding(x_size, width, size), Embedding(z_size, width, size)
        self.a, self.b = (nn.Sequential(nn.Linear(d, width), nn.ReLU(), nn.Linear(width, 1)) for d in (x_size, z_size))
        self.log_scale = nn.Parameter(torch.zeros(()))

    def forward(self, x: Tensor, z: Tensor) -> Tensor:
        """Scores [n, m] of x [n, d] with z [m, k]."""
        f, g = self.f(x), self.g(z)
        squares = (f * f).sum(1)[:, None] + (g * g).sum(1) - 2 * f @ g.T
        return self.a(x) + self.b(z).T - self.log_scale.exp() * squares


class Embedding(nn.Module):
    """Two hidden layers beside a linear map."""

    def __init__(self, inputs: int, width: int, outputs: int) -> None:
        super().__init__()
        self.bent = nn.Sequential(
            nn.Linear(inputs, width), nn.ReLU(), nn.Linear(width, width), nn.ReLU(), nn.Linear(width, outputs)
        )
        self.straight = nn.Linear(inputs, outputs)

    def forward(self, x: Tensor) -> Tensor:
        return self.bent(x) + self.straight(x)


class PaperCritic(nn.Module):
    """dropout, dense 512, batch norm, ReLU, dropout, dense 1, no biases, on phi and z in one row; one score per row."""

    def __init__(self, x_size: int, z_size: int, settings: PaperSettings) -> None:
        super().__init__()
        width = settings.width
        self.layers = nn.Sequential(
            nn.Dropout(settings.dropout),
            nn.Linear(x_size + z_size, width, bias=False),
            nn.BatchNorm1d(width),
            nn.ReLU(),
            nn.Dropout(settings.dropout),
            nn.Linear(width, 1, bias=False),
        )

    def forward(self, x: Tensor, z: Tensor) -> Tensor:
        """Scores [n] of x [n, d] with z [n, k]."""
        return self.layers(torch.cat([x, z], 1)).squeeze(1)


Objective = Callable[[Tensor, Tensor], Tensor]
"""What is maximised, of scores of all pairs [n, n] and which of them are marginal pairs, float [n, n]."""


def jsd_value(scores: Tensor, marginal: Tensor) -> Tensor:
    """E_J[log 2 - softplus(-T)] - E_M[softplus(T) - log 2]: at most twice the Jensen-Shannon divergence, 2 log 2."""
    return 2 * math.log(2) - F.softplus(-scores.diagonal()).mean() - _mean(F.softplus(scores), marginal)


def infonce_value(scores: Tensor, marginal: Tensor) -> Tensor:
    """Mean over i of T_ii - log mean_j exp T_ij (van den Oord et al. 2018): a lower bound of I, at most log n."""
    among = scores.masked_fill((marginal == 0) & ~torch.eye(len(scores), dtype=torch.bool), -math.inf)
    count = torch.isfinite(among).sum(1)
    return (scores.diagonal() - among.logsumexp(1) + count.log()).mean()


def smile_value(scores: Tensor, marginal: Tensor, clip: float) -> Tensor:
    """E_J[T] - log E_M[exp clip(T, ±clip)] (Song and Ermon 2020): an estimate of I, no bound of it."""
    partition = scores.clamp(-clip, clip).masked_fill(marginal == 0, -math.inf)
    return scores.diagonal().mean() - partition.flatten().logsumexp(0) + marginal.sum().log()


def _mean(values: Tensor, weights: Tensor) -> Tensor:
    return (values * weights).sum() / weights.sum()


def marginal_pairs(group: Tensor) -> Tensor:
    """Which pairs [n, n] are of different groups (float 0 or 1); raises :class:`SegarError` if none are."""
    pairs = (group[:, None] != group).float()
    if not pairs.any():
        raise SegarError("all frames are of one episode: there is no pair of frames that are independent")
    return pairs


def train_distance_critic(
    x: Tensor, z: Tensor, group: Tensor, objective: Objective, settings: CriticSettings, rng: torch.Generator
) -> DistanceCritic:
    """A critic that maximises ``objective`` on pairs ``x`` [n, d], ``z`` [n, k], whose marginal pairs are of two groups."""
    critic = DistanceCritic(x.shape[1], z.shape[1], settings)
    draw_weights(critic, rng)
    optimizer = torch.optim.Adam(critic.parameters(), settings.learning_rate)
    schedule = torch.optim.lr_scheduler.CosineAnnealingLR(optimizer, settings.steps)
    size = min(settings.batch, len(x))
    for _ in range(settings.steps):
        rows = torch.randperm(len(x), generator=rng)[:size]
        loss = -objective(critic(x[rows], z[rows]), marginal_pairs(group[rows]))
        optimizer.zero_grad()
        loss.backward()
        optimizer.step()
        schedule.step()
    return critic.eval()


def train_paper_critic(
    x: Tensor,
    z: Tensor,
    shuffle: Callable[[Tensor, Tensor], tuple[Tensor, Tensor]],
    settings: PaperSettings,
    rng: torch.Generator,
) -> PaperCritic:
    """The critic of 2022, trained on pairs and on what ``shuffle`` makes of them.

    Raises:
        SegarError: there are fewer pairs than a batch. The 2022 code dropped such runs without a word.
    """
    if len(x) < settings.batch:
        raise SegarError(f"{len(x)} pairs are fewer than a batch of {settings.batch}; collect more frames")
    critic = PaperCritic(x.shape[1], z.shape[1], settings)
    draw_weights(critic, rng)
    optimizer = torch.optim.Adam(critic.parameters(), settings.learning_rate)
    with torch.random.fork_rng([]):
        torch.manual_seed(int(torch.randint(2**31, (), generator=rng)))  # dropout reads no other generator
        for _ in range(settings.epochs):
            order = torch.randperm(len(x), generator=rng)
            for rows in order[: len(x) // settings.batch * settings.batch].split(settings.batch):
                joint, marginal = critic(x[rows], z[rows]), critic(*shuffle(x[rows], z[rows]))
                loss = F.softplus(-joint).mean() + F.softplus(marginal).mean()
                optimizer.zero_grad()
                loss.backward()
                optimizer.step()
    return critic.eval()


def draw_weights(critic: nn.Module, rng: torch.Generator) -> None:
    """Uniform weights within 1 / sqrt(inputs), from ``rng``; biases 0."""
    for layer in critic.modules():
        if isinstance(layer, nn.Linear):
            bound = layer.in_features**-0.5
            nn.init.uniform_(layer.weight, -bound, bound, generator=rng)
            if layer.bias is not None:
                nn.init.zeros_(layer.bias)


@torch.no_grad()
def accuracy_of_all_pairs(critic: DistanceCritic, x: Tensor, z: Tensor, group: Tensor) -> tuple[float, float]:
    """Share of the pairs that belong together that T > 0 says so of, and of all others, of two groups, with T < 0."""
    right = wrong = of_two = 0.0
    for rows in torch.arange(len(x)).split(CHUNK):
        scores = critic(x[rows], z)
        marginal = (group[rows, None] != group).float()
        wrong += float(((scores < 0) * marginal).sum())
        of_two += float(marginal.sum())
        right += float((scores[torch.arange(len(rows)), rows] > 0).sum())
    if not of_two:
        raise SegarError("all frames are of one episode: there is no pair of frames that are independent")
    return right / len(x), wrong / of_two


def torch_rng(rng: np.random.Generator) -> torch.Generator:
    """A generator of torch's that is decided by a draw from ``rng``."""
    return torch.Generator().manual_seed(int(rng.integers(2**31)))
