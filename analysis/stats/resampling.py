"""Intervals and tests that respect what runs share: the jackknife of whole clusters, permutation within panels."""

import dataclasses
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
import pandas as pd
from scipy import stats

from segar.analysis.stats.association import PANEL, keys, require
from segar.analysis.stats.correlation import residuals
from segar.analysis.stats.estimate import Estimate, mean_of_replicates, student_p
from segar.analysis.tables import Floats, column, keep
from segar.errors import SegarError

RESAMPLES = 2000
FEWEST_UNITS = 3  # that an interval of a mean is given of
Statistic = Callable[[Any], float]


def no_interval(value: float, count: int, blocks: str = "blocks") -> Estimate:
    """A number of fewer blocks than an interval takes; ``note`` says how many there are."""
    note = f"one {blocks.removesuffix('s')} has no interval" if count == 1 else f"{count} {blocks}: no interval"
    return Estimate(float(value), np.nan, np.nan, count, note=note)


def by_blocks(
    table: pd.DataFrame,
    statistic: Statistic,
    clusters: Sequence[str],
    least: int,
    called: str = "blocks",
    *,
    values: Floats,
    correlation: bool = False,
) -> Estimate:
    """:func:`cluster_jackknife`; of fewer than ``least`` clusters, which the note gives the name ``called``, no interval."""
    count = len(set(keys(table, clusters)))
    if count < least:
        return no_interval(statistic(values), count, called)
    return cluster_jackknife(table, statistic, clusters, values=values, correlation=correlation)


def mean_of_units(
    values: Sequence[float] | Floats,
    called: str,
    least: float = -np.inf,
    most: float = np.inf,
    chance: float | None = None,
) -> Estimate:
    """The mean of independent units with Student's interval, which ends at ``least`` and ``most``, and the two-sided p of
    ``chance``; of fewer than three units, no interval."""
    if 0 < len(values) < FEWEST_UNITS:
        return no_interval(float(np.mean(values)), len(values), called)
    found = mean_of_replicates(values, chance, sides=2)
    return dataclasses.replace(found, low=max(found.low, least), high=min(found.high, most))


def partial(values: Floats) -> float:
    """The correlation of the first two columns given the others, which have a constant among them."""
    return cosine(*residuals(values[:, :2], values[:, 2:]).T)


def cluster_jackknife(
    table: pd.DataFrame,
    statistic: Statistic,
    clusters: Sequence[str],
    *,
    values: Floats | None = None,
    correlation: bool = False,
) -> Estimate:
    """A statistic of a table, with an interval from leaving out one cluster of rows at a time: for few clusters.

    The error is sqrt((G - 1) / G sum (theta_g - theta)²) over the G clusters that are left out, the distribution Student's
    with G - 1 degrees of freedom (CV3 of MacKinnon, Nielsen and Webb 2023). Of a mean of clusters of one size it is Student's
    test of their means. Rows of a cluster, such as the runs of one seed in one panel, whose training levels are nested, stay
    together. A bootstrap would say too much of few clusters (docs/decisions/0012-few-blocks.md). ``n`` counts clusters; ``p``
    is that of 0, two-sided. Neither interval nor p where it makes no difference which cluster is left out.

    Args:
        statistic: of a table of rows.
        clusters: columns whose combinations are the clusters.
        values: [rows, ...], what ``statistic`` gets rows of in place of the table; ten times faster than a table.
        correlation: the interval is made of Fisher's transform of the statistic.

    Raises:
        SegarError: there are fewer than 2 clusters, or a column or a value of one is missing.
    """
    require(table, *clusters)
    place = keys(table, clusters)
    count = len(set(place))
    if count < 2:
        raise SegarError(
            f"a jackknife of clusters needs at least 2 of them; there is {count}, by {', '.join(clusters)}"
        )
    whole = float(statistic(table if values is None else values))
    left = [place != k for k in range(count)]
    parts = np.array([statistic(keep(table, rows) if values is None else values[rows]) for rows in left], np.float64)
    if not np.isfinite([whole, *parts]).all():
        return Estimate(whole, np.nan, np.nan, count, note="without one of the clusters it has no value")
    there, back = (to_normal, np.tanh) if correlation else (np.asarray, np.asarray)
    error = float(np.sqrt((count - 1) / count * np.square(there(parts) - there(whole)).sum()))
    half = float(stats.t.ppf(0.975, count - 1)) * error
    middle = float(there(whole))
    p = student_p(middle, error, count - 1, sides=2)
    return Estimate.between(whole, float(back(middle - half)), float(back(middle + half)), count, p)


def permutation_of_blocks(
    table: pd.DataFrame, x: str, y: str, given: Floats, rng: np.random.Generator, *, resamples: int = RESAMPLES
) -> Estimate:
    """Correlation of ``x`` and ``y`` given covariates, with the p of permuting whole blocks of x within panels.

    A panel is a family and difficulty, and a block the runs of one seed in it, whose training levels are nested over n. What
    the covariates leave of x is dealt to other blocks of the same panel, all rows of a block together and each to the row
    with the same n (Freedman and Lane 1983). A row whose partner is missing gets 0, the mean. (hits + 1) / (resamples + 1),
    two-sided; no interval.

    Args:
        given: [rows, covariates], with a constant among them.

    Raises:
        SegarError: a column or a value of one is missing, two rows have one block and n, no panel has two blocks, or
            nothing varies.
    """
    require(table, x, y, *PANEL, "seed", "n")
    a, b = column(table, x), column(table, y)
    if not np.isfinite(given).all():
        raise SegarError(f"a covariate of {x} and {y} has missing values: nothing to permute")
    left, right = residuals(a, given), residuals(b, given)
    if not all(np.linalg.norm(rest) > 1e-9 * np.linalg.norm(whole) for rest, whole in ((left, a), (right, b))):
        raise SegarError(f"{x} or {y} has missing values or does not vary given the covariates: nothing to permute")
    panels, blocks, places = (keys(table, names) for names in (PANEL, (*PANEL, "seed"), ("n",)))
    if len(set(zip(blocks, places, strict=True))) < len(table):
        raise SegarError("two rows of one panel have the same seed and n, and only one of them can be dealt")
    grid = np.zeros((blocks.max() + 1, places.max() + 1))
    grid[blocks, places] = left
    blocks_of = [np.unique(blocks[panels == k]) for k in range(panels.max() + 1)]
    if max(map(len, blocks_of)) < 2:
        raise SegarError("each panel has one block: there is nothing to permute")
    hat, observed, hits = np.linalg.pinv(given), cosine(left, right), 0
    source = np.arange(len(grid))
    for _ in range(resamples):
        for mine in blocks_of:
            source[mine] = rng.permutation(mine)
        dealt = grid[source[blocks], places]
        hits += abs(cosine(dealt - given @ (hat @ dealt), right)) >= abs(observed) - 1e-12
    p = (hits + 1) / (resamples + 1)
    return Estimate(observed, np.nan, np.nan, len(table), p, note="a permutation gives no interval")


def to_normal(r: Any) -> Floats:
    """Fisher's transform of correlations, finite at -1 and 1, too."""
    return np.arctanh(np.clip(r, -1 + 1e-12, 1 - 1e-12))


def cosine(a: Floats, b: Floats) -> float:
    """The cosine of two vectors, 0 where one is zero."""
    scale = float(np.linalg.norm(a) * np.linalg.norm(b))
    return float(a @ b) / scale if scale else 0.0
