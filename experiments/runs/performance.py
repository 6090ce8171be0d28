"""The figures of a run from its evaluation episodes, under the names of the columns that all tables have."""

import numpy as np
import pyarrow as pa
from numpy.typing import NDArray

from segar.experiments.settings import ACTION_MODES

Floats = NDArray[np.float64]
SETS = ("train", "test")
SHARES = ("success", "death", "length")


def performance(episodes: pa.Table) -> dict[str, float]:
    """The performance of a run on its levels, of each action mode in which training and test levels were played, whose name
    stands behind each of these:

    ``eta_train`` and ``eta_test`` (mean full return), ``gap`` = test - train, ``se_train``, ``se_test`` and ``gap_se``,
    ``success_train``, ``death_test`` and so on (shares), ``gap_ref`` (of returns without the last reward, as the 2022
    implementation counts), ``episodes_train`` and ``episodes_test``; of several trials on a level, the share of levels that are
    solved in each, as ``success_trial_0_test``.

    All training levels are played, so ``eta_train`` errs only where episodes on one level differ; test levels are a
    sample, so ``eta_test`` errs as the mean of independent levels does.
    """
    columns = {
        name: episodes.column(name).to_numpy() for name in episodes.column_names if not name.startswith("results/")
    }
    found: dict[str, float] = {}
    for mode in ACTION_MODES:
        rows = {levels: (columns["action_mode"] == mode) & (columns["levels"] == levels) for levels in SETS}
        if not all(played.any() for played in rows.values()):
            continue
        of_mode = {levels: {name: values[rows[levels]] for name, values in columns.items()} for levels in SETS}
        found |= {f"{name}_{mode}": value for name, value in _performance(of_mode, mode == "sampled").items()}
    return found


def _performance(of_mode: dict[str, dict[str, NDArray]], sampled: bool) -> dict[str, float]:
    """The figures of one action mode, from the columns of each level set."""
    row: dict[str, float] = {}
    reference = {}
    for levels, part in of_mode.items():
        fixed = levels == "train"
        eta, error = level_mean(part["level"], part["return"], fixed=fixed, sampled=sampled)
        row |= {f"eta_{levels}": eta, f"se_{levels}": error}
        row |= {f"{name}_{levels}": float(part[name].astype(np.float64).mean()) for name in SHARES}
        row[f"episodes_{levels}"] = len(part["level"])
        reference[levels] = level_mean(part["level"], part["return_ref"], fixed=True, sampled=False)[0]
    row["gap"] = row["eta_test"] - row["eta_train"]
    row["gap_se"] = float(np.hypot(row["se_train"], row["se_test"]))
    row["gap_ref"] = reference["test"] - reference["train"]
    for levels, part in of_mode.items():
        trials = np.unique(part["trial"]) if "trial" in part else np.zeros(1)
        for trial in trials if len(trials) > 1 else ():
            solved = part["success"][part["trial"] == trial].astype(np.float64)
            row[f"success_trial_{trial}_{levels}"] = float(solved.mean())
    return row


def level_mean(level: Floats, returns: Floats, *, fixed: bool, sampled: bool) -> tuple[float, float]:
    """Mean over levels of the mean return on each, and its standard error; ``level`` and ``returns`` are [episodes].

    Levels that are a sample: the error of a mean of independent levels, NaN for one level. Levels that are ``fixed``:
    the error that repeated episodes on a level show. Where each was played once there is nothing to see it from: with
    deterministic actions it is zero, with ``sampled`` ones the error of a sample of levels is an upper bound.
    """
    _, place, count = np.unique(level, return_inverse=True, return_counts=True)
    means = np.bincount(place, returns) / count
    if fixed and (count > 1).all():
        variance = np.bincount(place, (returns - means[place]) ** 2) / (count - 1)
        return float(means.mean()), float(np.sqrt((variance / count).sum()) / len(count))
    if fixed and not sampled:
        return float(means.mean()), 0.0
    error = means.std(ddof=1) / np.sqrt(len(means)) if len(means) > 1 else np.nan
    return float(means.mean()), float(error)
