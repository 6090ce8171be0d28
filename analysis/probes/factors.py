"""One probe per factor: can it be read off the representation, linearly or at all, on episodes that were not seen?"""

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import pandas as pd

from segar.analysis.probes.entropy import BINS, Quantised, quantise
from segar.analysis.probes.nearest import ksg_estimate
from segar.analysis.probes.pairs import Pairs, episode_folds, standardised_representation
from segar.analysis.probes.readouts import predict_linear, predict_mlp
from segar.analysis.stats.estimate import Estimate, student_p
from segar.analysis.stats.resampling import FEWEST_UNITS, no_interval
from segar.analysis.tables import Floats, Ints
from segar.experiments.settings import require_known

PROBES = {"ridge": predict_linear, "mlp": predict_mlp}
FOLDS = 2
RESAMPLES = 1000
COLUMNS = (
    "factor", "probe", "quantity", "estimate", "low", "high", "n", "p", "level", "note", "frames", "static",
    "entropy", "entropy_of",
)  # fmt: skip


def probe_factors(
    pairs: Pairs, rng: np.random.Generator, *, probes: Sequence[str] = tuple(PROBES), nearest: bool = True
) -> pd.DataFrame:
    """What can be read of each factor: one row per factor, probe and quantity.

    Every prediction is for an episode that its probe did not see (cross-fitted, whole episodes to a fold). Quantities:

    ``r2``            of numbers: 1 - squared error / variance, over all held-out frames; below 0 is worse than the mean
    ``accuracy``      of categories: mean over categories of the share that is recognised (balanced)
    ``information``   nats that the held-out prediction has about the factor's cell (:mod:`segar.analysis.probes.entropy`),
                      hence no more than the representation has on average: mean of log q(cell | prediction) - log p(cell), q
                      being counted on other episodes. Below 0: nothing could be learned from so few episodes, as ``note``
                      says of every quantity that is not told from that of knowing nothing
    ``fraction``      the same as a share of the cell's entropy, which is exact where ``entropy_of`` is "law", and of the
                      frames at hand where it is "sample"
    ``ksg``           nats between prediction and number by nearest neighbours, from one frame of each episode; where
                      ``nearest`` asks for it

    ``n`` counts episodes, and intervals are over episodes; ``p`` is one-sided, of the probe being no better than a
    constant. ``entropy`` [nats] is that of the factor cut into at most 8 cells. Frames of an episode share their
    static factors: estimates that took them for independent would find information where there is none.

    Raises:
        SegarError: a probe is unknown, or there are fewer episodes than folds.
    """
    for name in probes:
        require_known("probe", name, PROBES)
    parts = episode_folds(pairs.episode, FOLDS, rng)
    x = standardised_representation(pairs.representation)
    rows: list[dict[str, Any]] = []
    for probe in probes:
        predicted = PROBES[probe](x, pairs, parts, rng)
        for k, column in enumerate(pairs.columns):
            there = np.isfinite(pairs.factors[:, k])
            z, group = pairs.factors[there, k], pairs.episode[there]
            base = {"factor": column.name, "probe": probe, "frames": int(there.sum()), "static": column.is_static}
            if reason := why_not(z, group):
                quantity = "accuracy" if column.is_category else "r2"
                rows.append(Estimate.missing(len(np.unique(group)), reason).row(**base, quantity=quantity))
                continue
            has_prediction = np.isfinite(predicted[there, k])
            guess, z, group = predicted[there, k][has_prediction], z[has_prediction], group[has_prediction]
            cells = quantise(column, z)
            estimates = (category_estimates if column.is_category else number_estimates)(guess, z, cells, group, rng)
            if nearest and not column.is_category:
                # The last digits, so that equal predictions are no ties.
                blur = 1e-9 * (float(np.ptp(guess)) or 1e-12)
                estimates["ksg"] = ksg_estimate(guess + blur * rng.standard_normal(len(guess)), z, rng, group)
            nothing = {"accuracy": 1 / len(np.unique(z))}  # of all others it is 0
            data = f"{len(z)} frames of {len(np.unique(group))} episodes"
            estimates = {name: one.told_from(nothing.get(name, 0.0), data) for name, one in estimates.items()}
            entropy = {"entropy": cells.entropy, "entropy_of": cells.source}
            rows += [one.row(**base, **entropy, quantity=name) for name, one in estimates.items()]
    return pd.DataFrame(rows, columns=list(COLUMNS))


def why_not(z: Floats, group: Ints) -> str:
    """Why this factor cannot be probed; empty where it can."""
    if len(np.unique(group)) < 2 * FOLDS:
        return f"it is there in {len(np.unique(group))} episodes; {2 * FOLDS} are needed"
    return "it does not vary in these frames" if np.ptp(z) <= 1e-12 * np.abs(z).max() else ""


def number_estimates(
    predicted: Floats, z: Floats, cells: Quantised, group: Ints, rng: np.random.Generator
) -> dict[str, Estimate]:
    """What predictions [n] know of a factor [n] that is a number, by quantity."""
    edges = np.unique(np.quantile(predicted, np.arange(1, BINS) / BINS))
    information = information_estimates(np.searchsorted(edges, predicted), z, cells, group, rng)
    error, spread = (z - predicted) ** 2, (z - z.mean()) ** 2
    return {"r2": ratio_over_groups(spread - error, spread, group, rng), **information}


def category_estimates(
    predicted: Floats, z: Floats, cells: Quantised, group: Ints, rng: np.random.Generator
) -> dict[str, Estimate]:
    """What predictions [n] know of a factor [n] that is a category, by quantity."""
    classes, label = np.unique(z, return_inverse=True)
    guess = np.searchsorted(classes, predicted)
    weight = 1.0 / np.bincount(label)[label] / len(classes)
    accuracy = ratio_over_groups((guess == label) * weight, weight, group, rng, above=1 / len(classes))
    return {"accuracy": accuracy, **information_estimates(guess, z, cells, group, rng)}


def information_estimates(
    guess: Ints, z: Floats, cells: Quantised, group: Ints, rng: np.random.Generator
) -> dict[str, Estimate]:
    """Information [nats] of predictions, as small whole numbers [n], about the cells of ``z``; and as a share of entropy."""
    gain = information_gain(guess, cells.cells(z), cells.probabilities, group, rng)
    nats = ratio_over_groups(gain, np.ones(len(z)), group, rng)
    if cells.entropy == 0:
        return {"information": nats, "fraction": Estimate.missing(nats.n, "nearly all of its values are the same")}
    low, value, high = (float(v / cells.entropy) for v in (nats.low, nats.estimate, nats.high))
    return {"information": nats, "fraction": replace(nats, estimate=value, low=low, high=high)}


def information_gain(
    prediction: Ints, cell: Ints, probabilities: Floats, group: Ints, rng: np.random.Generator
) -> Floats:
    """log q(cell | prediction) - log p(cell) of each frame [nats], both in small whole numbers.

    q is counted on the other folds, each episode with weight 1 whatever its length, and drawn to p with the weight of
    one episode.
    """
    size = prediction.max() + 1
    _, place, length = np.unique(group, return_inverse=True, return_counts=True)
    weight = 1.0 / length[place]
    out = np.empty(len(cell))
    for held_out in episode_folds(group, FOLDS, rng):
        rest = np.setdiff1d(np.arange(len(cell)), held_out)
        counts = np.zeros((size, len(probabilities)))
        np.add.at(counts, (prediction[rest], cell[rest]), weight[rest])
        q = (counts + probabilities) / (counts.sum(axis=1, keepdims=True) + 1.0)
        chosen = cell[held_out]
        out[held_out] = np.log(q[prediction[held_out], chosen]) - np.log(probabilities[chosen])
    return out


def ratio_over_groups(
    top: Floats, bottom: Floats, group: Ints, rng: np.random.Generator, above: float = 0.0
) -> Estimate:
    """sum(top) / sum(bottom) with a bootstrap interval over groups; ``p`` that it is not more than ``above``, one-sided."""
    names, place = np.unique(group, return_inverse=True)
    n = len(names)
    tops, bottoms = np.bincount(place, top), np.bincount(place, bottom)
    value = float(tops.sum() / bottoms.sum())
    if n < FEWEST_UNITS:
        return no_interval(value, n, "groups")
    drawn = rng.integers(n, size=(RESAMPLES, n))
    resampled = tops[drawn].sum(axis=1) / np.maximum(bottoms[drawn].sum(axis=1), 1e-300)
    low, high = (float(v) for v in np.quantile(resampled, (0.025, 0.975)))
    excess = tops - above * bottoms
    p = student_p(float(excess.mean()), float(excess.std(ddof=1)) / np.sqrt(n), n - 1)
    return Estimate.between(value, low, high, n, p)
