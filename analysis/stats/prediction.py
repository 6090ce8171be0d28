"""How well a line through some groups of runs predicts a group that it did not see."""

from collections.abc import Mapping, Sequence

import numpy as np
import pandas as pd

from analysis.stats.association import labels, require
from analysis.stats.correlation import explained


def left_out(
    table: pd.DataFrame,
    y: str,
    predictors: Mapping[str, Sequence[str]],
    groups: Sequence[str] = ("family", "difficulty"),
) -> pd.DataFrame:
    """R² of least squares on each set of columns: of the runs themselves, and of groups that were left out in turn.

    Columns: ``predictors``, ``r2``, ``adjusted_r2``, ``r2_left_out`` and ``n`` (runs). ``r2_left_out`` is
    1 - (squared errors on the groups left out) / (squared deviations from the mean of the runs that were seen); it is
    negative where the mean of the other groups predicts better. NaN where there are too few runs, or one group.
    """
    require(table, y, *groups, *(name for names in predictors.values() for name in names))
    target = table[y].to_numpy(np.float64)
    place = labels(table, groups)
    rows = []
    for name, columns in predictors.items():
        x = table[list(columns)].to_numpy(np.float64)
        r2 = explained(target, x)
        freedom = len(target) - x.shape[1] - 1
        adjusted = 1 - (1 - r2) * (len(target) - 1) / freedom if freedom > 0 else np.nan
        rows.append({"predictors": name, "r2": r2, "adjusted_r2": adjusted, "r2_left_out": unseen(target, x, place)})
    return pd.DataFrame(rows).assign(n=len(target))


def unseen(y: np.ndarray, x: np.ndarray, place: np.ndarray) -> float:
    """R² of predictions for each group from the runs of all others."""
    names = np.unique(place)
    design = np.column_stack([np.ones(len(y)), x])
    wrong = base = 0.0
    for name in names:
        out = place == name
        if len(names) < 2 or (~out).sum() <= design.shape[1]:
            return float("nan")
        line = np.linalg.lstsq(design[~out], y[~out], rcond=None)[0]
        wrong += float(((y[out] - design[out] @ line) ** 2).sum())
        base += float(((y[out] - y[~out].mean()) ** 2).sum())
    return 1 - wrong / base if base else float("nan")
