"""Critics: functions T(x, z) that learn to tell pairs that belong together from pairs that do not."""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
import torch
from torch import Tensor, nn
from torch.nn import functional as F

from segar.errors import SegarError


@dataclass(frozen=True)
class CriticSettings:
    """The critic that compares embeddings, and how it learns; chosen so that z = phi is told apart from 1 to 16 numbers."""

    steps: int = 300
    batch: int = 128
    learning_rate: float = 1e-2  # falls to 0 along a cosine
    width: int = 64
    embedding: int = 16


# Of the critic of the 2022 code, and how it learnt: a dense layer on phi and z in one row.
PAPER_EPOCHS, PAPER_BATCH = 15, 64  # what is left over at the end of an epoch is dropped
PAPER_LEARNING_RATE, PAPER_WIDTH, PAPER_DROPOUT = 3e-4, 512, 0.1


class DistanceCritics(nn.Module):
    """Critics side by side, T(x_i, z_j) = a(x_i) + b(z_j) - s |f(x_i) - g(z_j)|² for all i and j at once.

    All four are networks; in a batch of matrix products ten critics cost what four cost one after the other. A layer on
    the concatenation of x and z, as in the 2022 code, takes many more samples to see that 8 numbers agree.
    """

    def __init__(self, critics: int, x_size: int, z_size: int, settings: CriticSettings) -> None:
        super().__init__()
        self.of_x, self.of_z = (Embeddings(critics, size, settings) for size in (x_size, z_size))
        self.log_scale = nn.Parameter(torch.zeros(critics, 1, 1))

    def forward(self, x: Tensor, z: Tensor) -> Tensor:
        """Scores [critics, n, m] of x [critics, n, d] with z [critics, m, k]."""
        (f, a), (g, b) = self.of_x(x), self.of_z(z)
        squares = (f * f).sum(2)[:, :, None] + (g * g).sum(2)[:, None] - 2 * f @ g.mT
        return a + b.mT - self.log_scale.exp() * squares


class Embeddings(nn.Module):
    """Of each critic a map to an embedding, two hidden layers beside a linear map, and one to a number, by one hidden layer."""

    def __init__(self, critics: int, inputs: int, settings: CriticSettings) -> None:
        super().__init__()
        self.width, size = settings.width, settings.embedding
        # The three layers that read the inputs are one matrix.
        self.first = Layers(critics, inputs, 2 * self.width + size)
        self.second, self.third = Layers(critics, self.width, self.width), Layers(critics, self.width, size)
        self.number = Layers(critics, self.width, 1)

    def forward(self, v: Tensor) -> tuple[Tensor, Tensor]:
        """Embeddings [critics, n, size] and numbers [critics, n, 1] of v [critics, n, inputs]."""
        bent, hidden, straight = self.first(v).tensor_split([self.width, 2 * self.width], 2)
        embedding = self.third(self.second(bent.relu()).relu()) + straight
        return embedding, self.number(hidden.relu())


class Layers(nn.Module):
    """A dense layer of each critic."""

    def __init__(self, critics: int, inputs: int, outputs: int) -> None:
        super().__init__()
        self.weight = nn.Parameter(torch.empty(critics, inputs, outputs))
        self.bias = nn.Parameter(torch.zeros(critics, 1, outputs))

    def forward(self, v: Tensor) -> Tensor:
        return torch.baddbmm(self.bias, v, self.weight)


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

    def __init__(self, x_size: int, z_size: int) -> None:
        super().__init__()
        self.layers = nn.Sequential(
            nn.Dropout(PAPER_DROPOUT),
            nn.Linear(x_size + z_size, PAPER_WIDTH, bias=False),
            nn.BatchNorm1d(PAPER_WIDTH),
            nn.ReLU(),
            nn.Dropout(PAPER_DROPOUT),
            nn.Linear(PAPER_WIDTH, 1, bias=False),
        )

    def forward(self, x: Tensor, z: Tensor) -> Tensor:
        """Scores [n] of x [n, d] with z [n, k]."""
        return self.layers(torch.cat([x, z], 1)).squeeze(1)


Objective = Callable[[Tensor, Tensor], Tensor]
"""What is maximised, [critics], of scores of all pairs [critics, n, n] and which are marginal pairs, float [critics, n, n]."""


def jsd_value(scores: Tensor, marginal: Tensor) -> Tensor:
    """E_J[log 2 - softplus(-T)] - E_M[softplus(T) - log 2]: at most twice the Jensen-Shannon divergence, 2 log 2."""
    of_pairs = F.softplus(-_diagonal(scores)).mean(-1)
    others = (F.softplus(scores) * marginal).sum((-2, -1)) / marginal.sum((-2, -1))
    return 2 * math.log(2) - of_pairs - others


def infonce_value(scores: Tensor, marginal: Tensor) -> Tensor:
    """Mean over i of T_ii - log mean_j exp T_ij (van den Oord et al. 2018): a lower bound of I, at most log n."""
    own = torch.eye(scores.shape[-1], dtype=torch.bool)
    among = scores.masked_fill((marginal == 0) & ~own, -math.inf)
    count = torch.isfinite(among).sum(-1)
    return (_diagonal(scores) - among.logsumexp(-1) + count.log()).mean(-1)


def smile_value(scores: Tensor, marginal: Tensor, clip: float) -> Tensor:
    """E_J[T] - log E_M[exp clip(T, ±clip)] (Song and Ermon 2020): an estimate of I, no bound of it."""
    partition = scores.clamp(-clip, clip).masked_fill(marginal == 0, -math.inf)
    return _diagonal(scores).mean(-1) - partition.flatten(-2).logsumexp(-1) + marginal.sum((-2, -1)).log()


def _diagonal(scores: Tensor) -> Tensor:
    return scores.diagonal(dim1=-2, dim2=-1)


def marginal_pairs(group: Tensor) -> Tensor:
    """Which pairs [..., n, n] of ``group`` [..., n] are of different groups (float 0 or 1).

    Raises:
        SegarError: none are.
    """
    pairs = (group[..., :, None] != group[..., None, :]).float()
    if not pairs.any((-2, -1)).all():
        raise SegarError("all frames are of one episode: there is no pair of frames that are independent")
    return pairs


def train_distance_critics(
    x: Tensor,
    z: Tensor,
    group: Tensor,
    sets: Sequence[Tensor],
    objective: Objective,
    settings: CriticSettings,
    rng: torch.Generator,
) -> DistanceCritics:
    """A critic for each of ``sets``, of rows of ``x`` [N, d] and ``z`` [N, k], that maximises ``objective`` on these rows.

    Marginal pairs are of two groups.
    """
    critics = DistanceCritics(len(sets), x.shape[1], z.shape[1], settings)
    draw_weights(critics, rng)
    optimizer = torch.optim.Adam(critics.parameters(), settings.learning_rate, fused=True)
    size = min(settings.batch, *map(len, sets))
    for step in range(settings.steps):
        optimizer.param_groups[0]["lr"] = settings.learning_rate * (1 + math.cos(math.pi * step / settings.steps)) / 2
        rows = torch.stack([rows[torch.randperm(len(rows), generator=rng)[:size]] for rows in sets])
        loss = -objective(critics(x[rows], z[rows]), marginal_pairs(group[rows])).sum()
        descend(optimizer, loss)
    return critics.eval()


def train_paper_critic(
    x: Tensor, z: Tensor, shuffle: Callable[[Tensor, Tensor], tuple[Tensor, Tensor]], rng: torch.Generator
) -> PaperCritic:
    """The critic of 2022, trained on pairs and on what ``shuffle`` makes of them.

    Raises:
        SegarError: there are fewer pairs than a batch. The 2022 code dropped such runs without a word.
    """
    if len(x) < PAPER_BATCH:
        raise SegarError(f"{len(x)} pairs are fewer than a batch of {PAPER_BATCH}; collect more frames")
    critic = PaperCritic(x.shape[1], z.shape[1])
    draw_weights(critic, rng)
    optimizer = torch.optim.Adam(critic.parameters(), PAPER_LEARNING_RATE, fused=True)
    with torch.random.fork_rng([]):
        torch.manual_seed(int(torch.randint(2**31, (), generator=rng)))  # dropout reads no other generator
        for _ in range(PAPER_EPOCHS):
            order = torch.randperm(len(x), generator=rng)
            for rows in order[: len(x) // PAPER_BATCH * PAPER_BATCH].split(PAPER_BATCH):
                joint, marginal = critic(x[rows], z[rows]), critic(*shuffle(x[rows], z[rows]))
                loss = F.softplus(-joint).mean() + F.softplus(marginal).mean()
                descend(optimizer, loss)
    return critic.eval()


def descend(optimizer: torch.optim.Optimizer, loss: Tensor) -> None:
    """Takes a step down the gradient of the loss."""
    optimizer.zero_grad()
    loss.backward()
    optimizer.step()


def draw_weights(critic: nn.Module, rng: torch.Generator) -> None:
    """Uniform weights within 1 / sqrt(inputs), from ``rng``; biases 0."""
    for layer in critic.modules():
        if isinstance(layer, nn.Linear | Layers):
            inputs = layer.weight.shape[1]  # [outputs, inputs], and [critics, inputs, outputs]
            nn.init.uniform_(layer.weight, -(inputs**-0.5), inputs**-0.5, generator=rng)
            if layer.bias is not None:
                nn.init.zeros_(layer.bias)


def torch_rng(rng: np.random.Generator) -> torch.Generator:
    """A generator of torch's that is decided by a draw from ``rng``."""
    return torch.Generator().manual_seed(int(rng.integers(2**31)))
