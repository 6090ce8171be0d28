"""How well a line through some groups of runs predicts a group that it did not see."""

from collections.abc import Mapping, Sequence

import numpy as np
import pandas as pd

from segar.analysis.stats.association import PANEL, keys, require
from segar.analysis.stats.correlation import explained, why_not
from segar.analysis.tables import Floats, column


def left_out(
    table: pd.DataFrame, y: str, predictors: Mapping[str, Sequence[str]], groups: Sequence[str] = PANEL
) -> pd.DataFrame:
    """R² of least squares on each set of columns: of the runs themselves, and of groups that were left out in turn.

    Columns: ``predictors``, ``r2``, ``adjusted_r2``, ``r2_left_out`` and ``n`` (runs). ``r2_left_out`` is
    1 - (squared errors on the groups left out) / (squared deviations from the mean of the runs that were seen); it is
    negative where the mean of the other groups predicts better. NaN where there are too few runs,
    one group, or a missing value.
    """
    require(table, y, *groups, *(name for names in predictors.values() for name in names))
    target = column(table, y)
    place = keys(table, groups)
    rows = []
    for name, columns in predictors.items():
        x = np.column_stack([np.empty((len(table), 0)), *(column(table, one) for one in columns)])
        r2 = explained(target, x)
        freedom = len(target) - x.shape[1] - 1
        adjusted = 1 - (1 - r2) * (len(target) - 1) / freedom if freedom > 0 else np.nan
        unseen = gain(target, x, np.empty((len(target), 0)), place)
        rows.append({"predictors": name, "r2": r2, "adjusted_r2": adjusted, "r2_left_out": unseen})
    return pd.DataFrame(rows).assign(n=len(target))


def gain(y: Floats, x: Floats, base: Floats, groups: np.ndarray) -> float:
    """R² of least squares on a constant, ``base`` and ``x`` over that without ``x``, [n, k] each, of groups that are left out
    in turn; NaN where there are too few rows or one group, ``y`` does not vary, or a value is not finite."""
    ones = np.ones((len(y), 1))
    without, with_x = np.column_stack([ones, base]), np.column_stack([ones, base, x])
    names, wrong = np.unique(groups), np.zeros(2)
    if why_not(y) or not np.isfinite(with_x).all():
        return float("nan")
    for name in names:
        out = groups == name
        if len(names) < 2 or (~out).sum() <= with_x.shape[1]:
            return float("nan")
        for k, design in enumerate((with_x, without)):
            line = np.linalg.lstsq(design[~out], y[~out], rcond=None)[0]
            wrong[k] += float(((y[out] - design[out] @ line) ** 2).sum())
    return 1 - wrong[0] / wrong[1] if wrong[1] else float("nan")
