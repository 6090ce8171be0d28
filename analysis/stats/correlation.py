"""How strongly two columns go together: correlations, partial correlations, a line with its confidence band.

Everything here is a pure function over float64 arrays with one entry per run. What cannot be computed, because there
are too few points or nothing varies, is :class:`NotAvailable` with the reason, never a NaN that looks like a number.

Runs share test levels, and training sets of one seed are nested in n, so the points are not independent: p-values that
assume they are come out too small. The report says so beside them.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import stats

from analysis.tables import Floats

MIN_POINTS = 3  # two points always lie on a line
MAX_ORDERS = 7  # points of which all orders are tried
ALL_ORDERS = 5040  # of seven points; scipy tries each once where there are no more


@dataclass(frozen=True)
class NotAvailable:
    """Stands where a statistic would, and says why there is none."""

    reason: str


@dataclass(frozen=True)
class Correlation:
    """Pearson's r and Spearman's rho, each with its two-sided p and 95 % interval; given covariates, both partial."""

    points: int
    pearson: float
    pearson_p: float
    pearson_low: float
    pearson_high: float
    spearman: float
    spearman_p: float
    spearman_low: float | None  # None: points in perfect order, about which Fisher's interval has nothing to say
    spearman_high: float | None


@dataclass(frozen=True)
class Line:
    """The least-squares line ``y = intercept + slope * x``, with what its confidence band needs."""

    points: int
    slope: float
    intercept: float
    residual_sd: float  # sqrt(sum of squared residuals / (points - 2))
    x_mean: float
    x_spread: float  # sum of (x - mean)^2

    def at(self, x: Floats) -> Floats:
        """The line's height at ``x`` [any shape]."""
        return self.intercept + self.slope * np.asarray(x, np.float64)

    def half_width(self, x: Floats, level: float = 0.95) -> Floats:
        """Half the height of the confidence band of the *mean* of y at ``x``; the band is ``at(x) ± half_width(x)``."""
        x = np.asarray(x, np.float64)
        quantile = stats.t.ppf(0.5 + level / 2, self.points - 2)
        return quantile * self.residual_sd * np.sqrt(1 / self.points + (x - self.x_mean) ** 2 / self.x_spread)


def correlate(x: Floats, y: Floats, covariates: Floats | None = None) -> Correlation | NotAvailable:
    """The correlation of ``x`` [n] and ``y`` [n], given ``covariates`` [n, k] where there are any.

    A partial correlation is that of the residuals of both after least squares on a constant and the covariates (for
    Spearman: of the residuals of their ranks). With k independent covariates its t has n - 2 - k degrees of freedom.
    The intervals are Fisher's, 1/sqrt(n - 3 - k) wide in arctanh r; for Spearman that is an approximation.
    Up to 7 points without covariates, Spearman's p counts all orders: t would call 4 points in order certain.
    """
    reason = why_not(x, y)
    if reason:
        return NotAvailable(reason)
    given = np.ones((len(x), 1)) if covariates is None else np.column_stack([np.ones(len(x)), covariates])
    freedom = len(x) - 1 - int(np.linalg.matrix_rank(given))
    if freedom < 1:
        return NotAvailable(f"{len(x)} points are too few for {given.shape[1] - 1} covariates")
    pearson = _partial(x, y, given, freedom)
    spearman = _partial(stats.rankdata(x), stats.rankdata(y), given, freedom)
    if isinstance(pearson, NotAvailable):
        return pearson
    if isinstance(spearman, NotAvailable):
        return spearman
    rho, rho_p, low, high = spearman
    if covariates is None and len(x) <= MAX_ORDERS:
        rho_p = _p_of_orders(stats.rankdata(x), stats.rankdata(y))
    interval = (None, None) if abs(rho) > 1 - EXPLAINED else (low, high)
    return Correlation(len(x), *pearson, rho, rho_p, *interval)


def fit_line(x: Floats, y: Floats) -> Line | NotAvailable:
    """The least-squares line through ``x`` [n] and ``y`` [n]."""
    reason = why_not(x, y)
    if reason:
        return NotAvailable(reason)
    found: Any = stats.linregress(x, y)
    slope, intercept = float(found.slope), float(found.intercept)
    residuals = y - intercept - slope * x
    return Line(
        points=len(x),
        slope=slope,
        intercept=intercept,
        residual_sd=float(np.sqrt(residuals @ residuals / (len(x) - 2))),
        x_mean=float(x.mean()),
        x_spread=float(((x - x.mean()) ** 2).sum()),
    )


def explained(y: Floats, predictors: Floats) -> float | NotAvailable:
    """R²: the share of the variance of ``y`` [n] that a constant and ``predictors`` [n, k] explain."""
    reason = why_not(y)
    if reason:
        return NotAvailable(reason)
    given = np.column_stack([np.ones(len(y)), predictors])
    if len(y) <= np.linalg.matrix_rank(given):
        return NotAvailable(f"{len(y)} points are too few for {given.shape[1] - 1} predictors")
    return 1 - float((residuals(y, given) ** 2).sum() / ((y - y.mean()) ** 2).sum())


def indicators(labels: Sequence[str]) -> Floats:
    """One column of zeros and ones for each label but the first: [n, number of labels - 1]."""
    names = np.asarray(labels, dtype=str)
    return (names[:, None] == np.unique(names)[None, 1:]).astype(np.float64)


def without_outliers(x: Floats, y: Floats, limit: float = 3.0) -> NDArray[np.bool_]:
    """Which points to keep [n]: those with |z| < ``limit`` in x and in y, z in standard deviations from the mean.

    With n points the largest possible |z| is sqrt(n - 1): below 10 points the paper's limit of 3 removes nothing.
    """
    keep = np.ones(len(x), bool)
    for column in (x, y):
        if len(column) > 1 and np.ptp(column) > 0:
            keep &= np.abs(column - column.mean()) < limit * column.std()
    return keep


def why_not(*columns: Floats) -> str:
    """Why no statistic can be had from these columns; empty where it can."""
    points = len(columns[0])
    if points < MIN_POINTS:
        return f"{points} point{'' if points == 1 else 's'}; at least {MIN_POINTS} are needed"
    if not all(np.isfinite(column).all() for column in columns):
        return "some values are missing or not finite"
    if any(np.ptp(column) == 0 for column in columns):
        return "all points have the same value"
    return ""


def residuals(y: Floats, given: Floats) -> Floats:
    """What least squares on the columns of ``given`` [n, k] leaves of ``y`` [n]."""
    return y - given @ np.linalg.lstsq(given, y, rcond=None)[0]


# What is left of a column that the covariates explain up to rounding, relative to the column.
EXPLAINED = 1e-10


def _partial(x: Floats, y: Floats, given: Floats, freedom: int) -> tuple[float, float, float, float] | NotAvailable:
    left, right = residuals(x, given), residuals(y, given)
    for column, rest in ((x, left), (y, right)):
        if np.linalg.norm(rest) <= EXPLAINED * np.linalg.norm(column - column.mean()):
            return NotAvailable("the covariates explain one of the two columns entirely")
    r = np.clip(left @ right / np.linalg.norm(left) / np.linalg.norm(right), -1, 1)
    with np.errstate(divide="ignore"):
        t = r * np.sqrt(freedom / (1 - r * r))
        centre = np.arctanh(r)
    half = stats.norm.ppf(0.975) / np.sqrt(freedom - 1) if freedom > 1 else np.inf
    low, high = (-1.0, 1.0) if np.isinf(half) else (float(np.tanh(centre - half)), float(np.tanh(centre + half)))
    return float(r), float(2 * stats.t.sf(abs(t), freedom)), low, high


def _p_of_orders(x: Floats, y: Floats) -> float:
    """The two-sided p of the correlation of ``x`` and ``y`` [n] among those of all n! pairings."""

    def centred_product(column: Floats, axis: int) -> Floats:
        return (column * (y - y.mean())).sum(axis=axis)

    return float(
        stats.permutation_test((x,), centred_product, permutation_type="pairings", n_resamples=ALL_ORDERS).pvalue
    )
