"""How much a representation knows of the factors: MINE and its accuracy, InfoNCE, SMILE."""

from collections.abc import Sequence
from functools import partial
from typing import Any, Literal, get_args

import numpy as np
import torch
from torch import Tensor

from segar.analysis.probes.critics import (
    CriticSettings,
    infonce_value,
    jsd_value,
    marginal_pairs,
    smile_value,
    torch_rng,
    train_distance_critics,
    train_paper_critic,
)
from segar.analysis.probes.pairs import Pairs, episode_folds, standardised, standardised_representation
from segar.analysis.stats.estimate import Estimate, mean_of_replicates
from segar.analysis.tables import Floats, Ints
from segar.errors import SegarError
from segar.experiments.settings import require_known

Marginal = Literal["joint", "paper"]
Split = tuple[Tensor, Tensor]  # rows to fit on, rows held out
Bound = Literal["jsd", "infonce", "smile"]
CHANCE = 0.5
REPLICATES = 5
FOLDS = 2
SMILE_CLIP = 5.0
MISSING_2022 = -1000.0
BLOCK = 256  # held-out pairs among which a bound is taken; InfoNCE is at most its logarithm, 5.5 nats


def mine_accuracy(
    representation: Any, factors: Any, rng: np.random.Generator, marginal: Marginal = "joint", *, episode: Any = None
) -> float:
    """How well a critic tells pairs (phi, z) that belong together from pairs that do not, from 0 to 1; 0.5 is chance.

    (share of joint pairs with T > 0 + share of marginal pairs with T < 0) / 2 of critics that maximise MINE's
    Jensen-Shannon bound (Hjelm et al. 2019). Cross-fitted: every pair is scored by a critic that did not see its fold.

    Args:
        representation: float ``[N, d]``.
        factors: float ``[N, k]``; may have nan, which is read as "not there".
        marginal: "joint" pairs phi with the z of another row, which makes p(phi) p(z), and uses a critic that compares
            embeddings. "paper" is the 2022 code's: every column of phi and of z is shuffled by itself, so that what is
            measured is any dependence among all columns, also within phi, by a critic on their concatenation.
        episode: int ``[N]``; marginal pairs are of two episodes, and no episode is split. None: rows are independent.

    Raises:
        SegarError: nothing varies, or there are too few pairs or episodes.
    """
    require_known("marginal", marginal, get_args(Marginal))
    x, z, group = _prepared(representation, factors, episode)
    splits = _splits(group, 1, rng)
    if marginal == "paper":
        return float(np.mean([_paper_fold(x, z, *split, torch_rng(rng)) for split in splits]))
    return float(_scores(x, z, group, splits, ("jsd",), CriticSettings(), rng)["jsd"][0, 0])


def estimate_bounds(
    pairs: Pairs,
    rng: np.random.Generator,
    bounds: Sequence[Bound],
    replicates: int = REPLICATES,
    settings: CriticSettings | None = None,
) -> dict[str, tuple[Estimate, Estimate]]:
    """Accuracy and value [nats] of bounds on the information between phi and all factors, means of replicates.

    ``p`` is that of chance, one-sided, over replicates of critic and folds, not of frames. InfoNCE has no accuracy,
    because it does not depend on where the zero of T lies. Values are those of held-out pairs. They can lie far below 0:
    a critic that learnt few episodes by heart is sure of itself, and wrong. Its accuracy is 0.5 then. ``note`` says so where
    an estimate is not told from that of knowing nothing.

    Args:
        bounds: "jsd" (MINE's, at most 2 log 2 nats), "infonce" (at most log 256 nats), "smile" (clip 5). "jsd" and
            "smile" are read off the same critics, which are trained as those of "jsd", as the authors of SMILE do.

    Raises:
        SegarError: as :func:`mine_accuracy`, or an argument is unknown.
    """
    for bound in bounds:
        require_known("bound", bound, get_args(Bound))
    x, z, group = _prepared(pairs.representation, pairs.factors, pairs.episode, pairs)
    found = {}
    data = f"{len(x)} frames of {len(np.unique(group))} episodes"
    splits = _splits(group, replicates, rng)
    for bound, scores in _scores(x, z, group, splits, bounds, settings or CriticSettings(), rng).items():
        accuracy = mean_of_replicates(scores[:, 0], CHANCE).told_from(CHANCE, data)
        if bound == "infonce":
            accuracy = Estimate.missing(replicates, "InfoNCE does not care where the zero of T lies")
        found[bound] = accuracy, mean_of_replicates(scores[:, 1], 0.0).told_from(0.0, data)
    return found


def mine_of_2022(train: Pairs, test: Pairs, rng: np.random.Generator, *, joint: bool = False) -> tuple[float, float]:
    """Accuracies as the paper plots them: (on the very pairs that the critic was fitted on, on those of test levels).

    Nothing is standardised, what is missing is -1000, and only those columns of z remain that vary among the training
    pairs. ``joint``: permute rows of z jointly, which is all that it takes to make the marginal right.

    Raises:
        SegarError: no factor varies, or there are fewer training pairs than a batch of 64.
    """
    generator = torch_rng(rng)
    keep = np.ptp(np.where(np.isnan(train.factors), MISSING_2022, train.factors), axis=0) > 0
    if not keep.any():
        raise SegarError("no factor varies among the training pairs")
    shuffle = partial(_shuffled_rows if joint else _shuffled_columns, rng=generator)
    sets = [
        (
            torch.as_tensor(pairs.representation, dtype=torch.float32),
            torch.as_tensor(np.where(np.isnan(z := pairs.factors[:, keep]), MISSING_2022, z), dtype=torch.float32),
        )
        for pairs in (train, test)
    ]
    critic = train_paper_critic(*sets[0], shuffle, generator)
    with torch.no_grad():
        first, second = (_accuracy_of_rows(critic(x, z), critic(*shuffle(x, z))) for x, z in sets)
    return first, second


def _prepared(
    representation: Any, factors: Any, episode: Any, pairs: Pairs | None = None
) -> tuple[Tensor, Tensor, Ints]:
    """Standardised tensors [N, d] and [N, m], and groups int [N]."""
    x, z = np.asarray(representation, np.float64), np.asarray(factors, np.float64)
    x, z = (column[:, None] if column.ndim == 1 else column for column in (x, z))
    if len(x) != len(z):
        raise SegarError(f"there are {len(x)} representations but factors of {len(z)} frames")
    if len(x) < 2 * FOLDS:
        raise SegarError(f"{len(x)} pairs are too few; at least {2 * FOLDS} are needed")
    if not np.isfinite(x).all():
        raise SegarError("the representation holds values that are not finite")
    group = np.arange(len(x)) if episode is None else np.asarray(episode, np.int64)
    seen = standardised(z, pairs.columns if pairs is not None else None)
    return torch.from_numpy(standardised_representation(x)), torch.from_numpy(seen), group


def _splits(group: Ints, replicates: int, rng: np.random.Generator) -> list[Split]:
    """The folds of all replicates, one after the other."""
    whole = torch.arange(len(group))
    parts = [torch.from_numpy(part) for _ in range(replicates) for part in episode_folds(group, FOLDS, rng)]
    return [(whole[~torch.isin(whole, held_out)], held_out) for held_out in parts]


def _scores(
    x: Tensor,
    z: Tensor,
    group: Ints,
    splits: Sequence[Split],
    bounds: Sequence[str],
    settings: CriticSettings,
    rng: np.random.Generator,
) -> dict[str, Floats]:
    """Of each bound the accuracy of its critic, whose chance is 0.5, and its value [nats], [replicates, 2], means over folds;
    all critics of an objective learn side by side."""
    values = {"jsd": jsd_value, "infonce": infonce_value, "smile": partial(smile_value, clip=SMILE_CLIP)}
    found = {}
    for objective in (jsd_value, infonce_value):
        wanted = {b: values[b] for b in bounds if (b == "infonce") == (objective is infonce_value)}
        if wanted:
            generator, episodes = torch_rng(rng), torch.from_numpy(group)
            critics = train_distance_critics(
                x, z, episodes, [rest for rest, _ in splits], objective, settings, generator
            )
            found |= _held_out(critics, x, z, episodes, [rows for _, rows in splits], wanted, generator)
    return {bound: found[bound].reshape(-1, FOLDS, 2).mean(axis=1) for bound in bounds}


@torch.no_grad()
def _held_out(critics, x, z, group, sets, values, rng) -> dict[str, Floats]:
    """Accuracy and value [critics, 2] of each critic on its own rows, which are drawn to equal number and scored in blocks of
    about 256."""
    size = min(map(len, sets))
    rows = torch.stack([one[torch.randperm(len(one), generator=rng)[:size]] for one in sets])
    accuracy, totals = torch.zeros(len(sets)), {name: torch.zeros(len(sets)) for name in values}
    blocks = rows.tensor_split(max(round(size / BLOCK), 1), 1)
    for block in blocks:
        scores, marginal = critics(x[block], z[block]), marginal_pairs(group[block])
        right = (scores.diagonal(dim1=1, dim2=2) > 0).float().mean(1)
        wrong = ((scores < 0) * marginal).sum((1, 2)) / marginal.sum((1, 2))
        accuracy += (right + wrong) / 2 / len(blocks)
        for name, value in values.items():
            totals[name] += value(scores, marginal) / len(blocks)
    return {name: torch.stack([accuracy, total], 1).double().numpy() for name, total in totals.items()}


def _paper_fold(x: Tensor, z: Tensor, rest: Tensor, held_out: Tensor, rng: torch.Generator) -> float:
    """The accuracy of the critic of 2022 on pairs that it was not fitted on."""
    shuffle = partial(_shuffled_columns, rng=rng)
    critic = train_paper_critic(x[rest], z[rest], shuffle, rng)
    with torch.no_grad():
        return _accuracy_of_rows(critic(x[held_out], z[held_out]), critic(*shuffle(x[held_out], z[held_out])))


def _accuracy_of_rows(joint: Tensor, marginal: Tensor) -> float:
    return float(((joint > 0).float().mean() + (marginal < 0).float().mean()) / 2)


def _shuffled_columns(x: Tensor, z: Tensor, rng: torch.Generator) -> tuple[Tensor, Tensor]:
    """Every column permuted by itself, as in 2022."""
    orders = [torch.rand(part.shape[::-1], generator=rng).argsort(1).T for part in (x, z)]
    return x.gather(0, orders[0]), z.gather(0, orders[1])


def _shuffled_rows(x: Tensor, z: Tensor, rng: torch.Generator) -> tuple[Tensor, Tensor]:
    """Rows of z permuted jointly."""
    return x, z[torch.randperm(len(z), generator=rng)]
