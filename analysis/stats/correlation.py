"""How strongly two columns go together: correlations, partial correlations, explained variance.

Everything here is a pure function over float64 arrays with one entry per run. What cannot be computed, because there
are too few points or nothing varies, is NaN, and the note of a correlation has the reason.

Runs share test levels, and training sets of one seed are nested in n, so the points are not independent: p-values that
assume they are come out too small. The report says so beside them.
"""

import dataclasses
from collections.abc import Sequence
from dataclasses import dataclass
from math import factorial
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import stats

from segar.analysis.stats.estimate import NOT_FINITE, ROUNDING, Estimate
from segar.analysis.tables import Floats

MIN_POINTS = 3  # two points always lie on a line
LIMIT = 3.0  # |z| from which on a point is an outlier, as the paper has it
PERFECT = "points in perfect order have no interval"
MAX_ORDERS = 7  # points of which all orders are tried
ALL_ORDERS = 5040  # of seven points; scipy tries each once where there are no more


@dataclass(frozen=True)
class Correlation:
    """Pearson's r and Spearman's rho, with their two-sided p and 95 % intervals; given covariates, both partial."""

    pearson: Estimate
    spearman: Estimate


def correlate(x: Floats, y: Floats, covariates: Floats | None = None) -> Correlation:
    """The correlation of ``x`` [n] and ``y`` [n], given ``covariates`` [n, k] where there are any.

    A partial correlation is that of the residuals of both after least squares on a constant and the covariates (for
    Spearman: of the residuals of their ranks). With k independent covariates its t has n - 2 - k degrees of freedom.
    The intervals are Fisher's, 1/sqrt(n - 3 - k) wide in arctanh r; for Spearman that is an approximation.
    Up to 7 points without covariates, Spearman's p counts all orders: t would call 4 points in order certain.
    """
    given = np.ones((len(x), 1)) if covariates is None else np.column_stack([np.ones(len(x)), covariates])
    if reason := why_not(x, y) or _why_no_partial(x, y, given):
        none = Estimate.missing(len(x), reason)
        return Correlation(none, none)
    freedom = len(x) - 1 - int(np.linalg.matrix_rank(given))
    rank_x, rank_y = stats.rankdata(x), stats.rankdata(y)
    spearman = _partial(rank_x, rank_y, given, freedom)
    if covariates is None and len(x) <= MAX_ORDERS:
        spearman = dataclasses.replace(spearman, p=_p_of_orders(rank_x, rank_y))
    return Correlation(_partial(x, y, given, freedom), spearman)


def explained(y: Floats, predictors: Floats) -> float:
    """R²: the share of the variance of ``y`` [n] that a constant and ``predictors`` [n, k] explain; NaN where there is none."""
    given = np.column_stack([np.ones(len(y)), predictors])
    if why_not(y) or not np.isfinite(given).all() or len(y) <= np.linalg.matrix_rank(given):
        return float("nan")
    return 1 - float((residuals(y, given) ** 2).sum() / ((y - y.mean()) ** 2).sum())


def indicators(labels: Sequence[str] | NDArray[Any]) -> Floats:
    """One column of zeros and ones for each label but the first: [n, number of labels - 1]."""
    names = np.asarray(labels)
    return (names[:, None] == np.unique(names)[None, 1:]).astype(np.float64)


def without_outliers(x: Floats, y: Floats) -> NDArray[np.bool_]:
    """Which points to keep [n]: those with |z| < 3 in x and in y, z in standard deviations from the mean.

    With n points the largest possible |z| is sqrt(n - 1): below 10 points the paper's limit of 3 removes nothing.
    """
    keep = np.ones(len(x), bool)
    for column in (x, y):
        if len(column) > 1 and np.ptp(column) > 0:
            keep &= np.abs(column - column.mean()) < LIMIT * column.std()
    return keep


def why_not(*columns: Floats) -> str:
    """Why no statistic can be had from these columns; empty where it can."""
    points = len(columns[0])
    if points < MIN_POINTS:
        return f"{points} point{'' if points == 1 else 's'}; at least {MIN_POINTS} are needed"
    if not all(np.isfinite(column).all() for column in columns):
        return NOT_FINITE
    if any(np.ptp(column) <= ROUNDING * np.abs(column).max() for column in columns):
        return "all points have the same value"
    return ""


def residuals(y: Floats, given: Floats) -> Floats:
    """What least squares on the columns of ``given`` [n, k] leaves of ``y`` [n]."""
    return y - given @ np.linalg.lstsq(given, y, rcond=None)[0]


# What is left of a column that the covariates explain up to rounding, relative to the column.
EXPLAINED = 1e-10


def _why_no_partial(x: Floats, y: Floats, given: Floats) -> str:
    """Why there is no correlation of two columns given others; empty where there is one."""
    if len(x) - 1 <= np.linalg.matrix_rank(given):
        return f"{len(x)} points are too few for {given.shape[1] - 1} covariates"
    for column in (x, y, stats.rankdata(x), stats.rankdata(y)):
        if np.linalg.norm(residuals(column, given)) <= EXPLAINED * np.linalg.norm(column - column.mean()):
            return "the covariates explain one of the two columns entirely"
    return ""


def _partial(x: Floats, y: Floats, given: Floats, freedom: int) -> Estimate:
    left, right = residuals(x, given), residuals(y, given)
    r = np.clip(left @ right / np.linalg.norm(left) / np.linalg.norm(right), -1, 1)
    with np.errstate(divide="ignore"):
        t = r * np.sqrt(freedom / (1 - r * r))
        centre = np.arctanh(r)
    half = stats.norm.ppf(0.975) / np.sqrt(freedom - 1) if freedom > 1 else np.inf
    low, high = (-1.0, 1.0) if np.isinf(half) else (float(np.tanh(centre - half)), float(np.tanh(centre + half)))
    if abs(r) > 1 - EXPLAINED:  # about which Fisher's interval has nothing to say, nor Student's p
        p = 2 / factorial(freedom + 2)  # of all orders of so many points, this one and its reverse
        return Estimate(float(r), np.nan, np.nan, len(x), p, note=PERFECT)
    return Estimate(float(r), low, high, len(x), float(2 * stats.t.sf(abs(t), freedom)))


def _p_of_orders(x: Floats, y: Floats) -> float:
    """The two-sided p of the correlation of ``x`` and ``y`` [n] among those of all n! pairings."""

    def centred_product(column: Floats, axis: int) -> Floats:
        return (column * (y - y.mean())).sum(axis=axis)

    found = stats.permutation_test((x,), centred_product, permutation_type="pairings", n_resamples=ALL_ORDERS)
    return float(found.pvalue)
