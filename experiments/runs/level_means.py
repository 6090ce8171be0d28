"""Means over levels of what episodes returned, and their standard errors."""

import numpy as np
import pyarrow as pa
from numpy.typing import NDArray

from experiments.settings import ACTION_MODES

Floats = NDArray[np.float64]


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


def gap_errors(episodes: pa.Table) -> dict[str, float]:
    """The standard errors of a run's gaps from its evaluation episodes, as ``gap_se_deterministic``; of each action mode in
    which both training and test levels were played, and where there is one."""
    modes, sets, level, returns = (
        episodes.column(name).to_numpy() for name in ("action_mode", "levels", "level", "return")
    )
    found = {}
    for mode in ACTION_MODES:
        errors = []
        for levels in ("train", "test"):
            played = (modes == mode) & (sets == levels)
            if played.any():
                fixed, sampled = levels == "train", mode == "sampled"
                errors.append(level_mean(level[played], returns[played], fixed=fixed, sampled=sampled)[1])
        if len(errors) == 2 and np.isfinite(errors).all():
            found[f"gap_se_{mode}"] = float(np.hypot(*errors))
    return found
