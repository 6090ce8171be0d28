"""One probe per factor: can it be read off the representation, linearly or at all, on episodes that were not seen?"""

from __future__ import annotations

import warnings
from collections.abc import Callable, Sequence
from dataclasses import asdict, replace
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray
from scipy import stats
from sklearn.exceptions import ConvergenceWarning
from sklearn.feature_selection import mutual_info_classif
from sklearn.linear_model import LogisticRegression, RidgeCV
from sklearn.neural_network import MLPClassifier, MLPRegressor

from analysis.probes.entropy import BINS, quantise
from analysis.probes.nearest import equivalent_r2, ksg_estimate
from analysis.probes.pairs import Column, Pairs, episode_folds, standardised_representation
from analysis.stats.estimate import Estimate
from segar.errors import SegarError, did_you_mean

PROBES = ("ridge", "mlp")
FOLDS = 2
ALPHAS = tuple(
    10.0 ** np.arange(-2, 6)
)  # of ridge, on standardised columns, chosen by leave-one-out on the training folds
RESAMPLES = 1000
MLP = {"hidden_layer_sizes": (128,), "max_iter": 100, "early_stopping": True, "n_iter_no_change": 10, "alpha": 1e-3}
classification_information: Any = mutual_info_classif  # whose stub knows discrete_features as a str alone
COLUMNS = (
    "factor", "probe", "quantity", "estimate", "low", "high", "n", "p", "level", "note", "frames", "static",
    "entropy", "entropy_of",
)  # fmt: skip


def probe_factors(
    pairs: Pairs,
    rng: np.random.Generator,
    *,
    probes: Sequence[str] = PROBES,
    folds: int = FOLDS,
    bins: int = BINS,
) -> pd.DataFrame:
    """What can be read of each factor: one row per factor, probe and quantity.

    Every prediction is for an episode that its probe did not see (cross-fitted, whole episodes to a fold). Quantities:

    ``r2``            of numbers: 1 - squared error / variance, over all held-out frames; below 0 is worse than the mean
    ``accuracy``      of categories: mean over categories of the share that is recognised (balanced)
    ``information``   nats between the held-out prediction and the factor (numbers: by nearest neighbours; categories: mean of
                      log predicted probability - log share), on average no more than the representation has
    ``r2_equivalent`` of numbers without law: 1 - exp(-2 information), the R² of two Gaussians with that information
    ``fraction``      nats between the held-out prediction and the factor's cell, as a share of the cell's entropy:
                      exact where ``entropy_of`` is "law", of the frames at hand where it is "sample"

    ``n`` counts episodes, and intervals are over episodes; ``p`` is one-sided, of the probe being no better than a
    constant. ``entropy`` [nats] is that of the factor cut into at most ``bins`` cells (:mod:`analysis.probes.entropy`).

    Raises:
        SegarError: a probe is unknown, or there are fewer episodes than folds.
    """
    for name in probes:
        if name not in PROBES:
            raise SegarError(f"probe '{name}' is unknown.{did_you_mean(name, PROBES)}")
    parts = episode_folds(pairs.episode, folds, rng)
    x = standardised_representation(pairs.representation)
    rows: list[dict[str, Any]] = []
    for probe in probes:
        predicted = predict_numbers(x, pairs, parts, probe, rng)
        for k, column in enumerate(pairs.columns):
            there = np.isfinite(pairs.factors[:, k])
            z, group = pairs.factors[there, k], pairs.episode[there]
            base = {"factor": column.name, "probe": probe, "frames": int(there.sum()), "static": column.is_static}
            reason = why_not(z, group, folds)
            if reason:
                quantity = "accuracy" if column.is_category else "r2"
                rows.append(base | {"quantity": quantity} | asdict(Estimate.missing(len(np.unique(group)), reason)))
            elif column.is_category:
                rows += category_rows(base, column, x[there], z, group, probe, folds, rng)
            else:
                rows += number_rows(base, column, predicted[there, k], z, group, bins, rng)
    return pd.DataFrame(rows, columns=list(COLUMNS))


def why_not(z: NDArray[np.float64], group: NDArray[np.int64], folds: int) -> str:
    """Why nothing can be asked of this factor; empty where it can."""
    if len(np.unique(group)) < 2 * folds:
        return f"it is there in {len(np.unique(group))} episodes; {2 * folds} are needed"
    return "it does not vary in these frames" if np.ptp(z) == 0 else ""


def predict_numbers(
    x: NDArray[np.float32], pairs: Pairs, parts: Sequence[NDArray[np.int64]], probe: str, rng: np.random.Generator
) -> NDArray[np.float64]:
    """Held-out predictions of all factors that are numbers, [N, k]; nan where the factor is missing.

    Factors that are there in the same frames are predicted together.
    """
    z = pairs.factors
    out = np.full(z.shape, np.nan)
    there = np.isfinite(z)
    numbers = [k for k, column in enumerate(pairs.columns) if not column.is_category and there[:, k].any()]
    alike: dict[bytes, list[int]] = {}
    for k in numbers:
        alike.setdefault(there[:, k].tobytes(), []).append(k)
    for columns in alike.values():
        mask = there[:, columns[0]]
        for held_out in parts:
            rest = np.setdiff1d(np.flatnonzero(mask), held_out)
            test = held_out[mask[held_out]]
            if len(rest) < 2 or not len(test):
                continue
            target = z[np.ix_(rest, np.array(columns))]
            mean, spread = target.mean(axis=0), target.std(axis=0)
            scaled = (target - mean) / np.where(spread > 0, spread, 1.0)
            model = fit_quietly(number_model(probe, rng), x[rest], scaled if len(columns) > 1 else scaled[:, 0])
            found = model.predict(x[test]).reshape(len(test), -1)
            out[np.ix_(test, np.array(columns))] = found * spread + mean
    return out


def number_model(probe: str, rng: np.random.Generator) -> Any:
    """scikit-learn's regression of that name."""
    if probe == "ridge":
        return RidgeCV(ALPHAS)
    return MLPRegressor(**MLP, random_state=int(rng.integers(2**31)))


def category_model(probe: str, rng: np.random.Generator) -> Any:
    """scikit-learn's classification: linear for "ridge", else a network."""
    if probe == "ridge":
        return LogisticRegression(C=0.1, max_iter=1000)
    return MLPClassifier(**MLP, random_state=int(rng.integers(2**31)))


def fit_quietly(model: Any, x: Any, z: Any) -> Any:
    """The fitted model; that a network was stopped at its last iteration is no news."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", ConvergenceWarning)
        return model.fit(x, z)


def number_rows(
    base: dict[str, Any],
    column: Column,
    predicted: NDArray[np.float64],
    z: NDArray[np.float64],
    group: NDArray[np.int64],
    bins: int,
    rng: np.random.Generator,
) -> list[dict[str, Any]]:
    """The rows of a factor that is a number."""
    found = np.isfinite(predicted)
    predicted, z, group = predicted[found], z[found], group[found]
    cells = quantise(column, z, bins)
    entropy = {"entropy": cells.entropy, "entropy_of": cells.source}
    error, spread = (z - predicted) ** 2, (z - z.mean()) ** 2
    rows = [base | {"quantity": "r2"} | asdict(ratio_over_groups(spread - error, spread, group, rng)) | entropy]
    information = ksg_estimate(jittered(predicted, rng), z, rng, group)
    rows.append(base | {"quantity": "information"} | asdict(information) | entropy)
    as_r2 = scaled(information, equivalent_r2)
    rows.append(base | {"quantity": "r2_equivalent"} | asdict(as_r2) | entropy)
    cell = cells.cells(z)
    if len(np.unique(cell)) > 1:
        rows.append(
            base
            | {"quantity": "fraction"}
            | asdict(cell_fraction(predicted, cell, cells.entropy, group, rng))
            | entropy
        )
    return rows


def category_rows(
    base: dict[str, Any],
    column: Column,
    x: NDArray[np.float32],
    z: NDArray[np.float64],
    group: NDArray[np.int64],
    probe: str,
    folds: int,
    rng: np.random.Generator,
) -> list[dict[str, Any]]:
    """The rows of a factor that is a category."""
    cells = quantise(column, z)
    entropy = {"entropy": cells.entropy, "entropy_of": cells.source}
    classes, label = np.unique(z, return_inverse=True)
    chance = np.full((len(z), len(classes)), np.nan)
    shares = np.full_like(chance, np.nan)
    for held_out in episode_folds(group, folds, rng):
        rest = np.setdiff1d(np.arange(len(z)), held_out)
        counts = np.bincount(label[rest], minlength=len(classes)) + 1.0  # a class that only the other fold has
        shares[held_out] = counts / counts.sum()
        known = np.unique(label[rest])
        chance[held_out] = shares[held_out]
        if len(known) > 1:
            model = fit_quietly(category_model(probe, rng), x[rest], label[rest])
            chance[held_out] *= 1 - len(rest) / (len(rest) + len(classes))
            chance[np.ix_(held_out, known)] += model.predict_proba(x[held_out]) * len(rest) / (len(rest) + len(classes))
    right = (chance.argmax(axis=1) == label).astype(float)
    weight = 1.0 / np.bincount(label)[label] / len(classes)
    accuracy = ratio_over_groups(right * weight, weight, group, rng, above=1 / len(classes))
    own = np.arange(len(z)), label
    gain = np.log(chance[own]) - np.log(shares[own])
    nats = ratio_over_groups(gain, np.ones(len(z)), group, rng)
    share = scaled(nats, lambda value: value / cells.entropy)
    named = (("accuracy", accuracy), ("information", nats), ("fraction", share))
    return [base | {"quantity": name} | asdict(one) | entropy for name, one in named]


def cell_fraction(
    predicted: NDArray[np.float64],
    cell: NDArray[np.int64],
    entropy: float,
    group: NDArray[np.int64],
    rng: np.random.Generator,
    parts: int = 10,
) -> Estimate:
    """I(prediction; cell) / ``entropy``, by nearest neighbours (Ross 2014); interval as of :func:`ksg_estimate`."""

    def information(rows: NDArray[Any]) -> float:
        seed = int(rng.integers(2**31))
        return float(
            classification_information(predicted[rows, None], cell[rows], discrete_features=False, random_state=seed)[0]
        )

    value = information(np.arange(len(cell))) / entropy
    names, place = np.unique(group, return_inverse=True)
    parts = min(parts, len(names) // 2, len(cell) // 20)
    if parts < 2:
        return Estimate(value, np.nan, np.nan, len(names), note="too few episodes for an interval")
    part_of = rng.permutation(np.arange(len(names)) % parts)[place]
    scatter = [information(np.flatnonzero(part_of == k)) / entropy for k in range(parts)]
    error = float(np.std(scatter, ddof=1) / np.sqrt(parts))
    half = float(stats.t.ppf(0.975, parts - 1)) * error
    p = float(stats.t.sf(value / error, parts - 1)) if error > 0 else float(value <= 0)
    return Estimate(value, value - half, value + half, len(names), p)


def ratio_over_groups(
    top: NDArray[np.float64],
    bottom: NDArray[np.float64],
    group: NDArray[np.int64],
    rng: np.random.Generator,
    above: float = 0.0,
) -> Estimate:
    """sum(top) / sum(bottom) with a bootstrap interval over groups; ``p`` that it is not more than ``above``, one-sided."""
    names, place = np.unique(group, return_inverse=True)
    n = len(names)
    tops, bottoms = np.bincount(place, top), np.bincount(place, bottom)
    value = float(tops.sum() / bottoms.sum())
    weights = rng.multinomial(n, np.full(n, 1 / n), size=RESAMPLES)
    resampled = (weights @ tops) / np.maximum(weights @ bottoms, 1e-300)
    low, high = (float(v) for v in np.quantile(resampled, (0.025, 0.975)))
    excess = tops - above * bottoms
    spread = float(excess.std(ddof=1))
    p = float(stats.t.sf(excess.mean() / (spread / np.sqrt(n)), n - 1)) if spread > 0 else float(excess.mean() <= 0)
    return Estimate(value, low, high, n, p)


def scaled(found: Estimate, function: Callable[[float], float]) -> Estimate:
    """The estimate and the ends of its interval through a function that rises."""
    value, low, high = (float(function(v)) for v in (found.estimate, found.low, found.high))
    return replace(found, estimate=value, low=low, high=high)


def jittered(x: NDArray[np.float64], rng: np.random.Generator) -> NDArray[np.float64]:
    """``x`` with the last digits blurred, so that equal predictions are no ties."""
    return x + 1e-9 * max(float(np.ptp(x)), 1e-12) * rng.standard_normal(len(x))
