"""What a design can find: power by simulation on the very distances that its runs have, and by Fisher's formula."""

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
import pandas as pd
from scipy import stats
from statsmodels.stats.power import TTestIndPower
from statsmodels.stats.proportion import proportion_confint

from analysis.stats.association import covariate_matrix, holm, labels, require
from analysis.stats.correlation import indicators
from analysis.tables import Floats
from segar.errors import SegarError

ALPHA = 0.05
PAPER_P = 1.47e-5  # the only p-value in the paper's text
REPLICATES = 400


def power_of_design(
    table: pd.DataFrame,
    x: str,
    rng: np.random.Generator,
    *,
    pooled_r: float = -0.6,
    panel: Sequence[str] = ("family", "difficulty"),
    given: Sequence[str] = ("n",),
    cluster: Sequence[str] = (),
    cluster_share: float = 0.0,
    alphas: Sequence[float] = (ALPHA, PAPER_P),
    replicates: int = REPLICATES,
) -> pd.DataFrame:
    """How often each test of :func:`analysis.stats.association.associations` would find a linear effect of ``x``.

    y = ±x + noise, with normal noise so large that the correlation over all runs is ``pooled_r`` on average: one slope
    in all panels, which is the assumption to keep in mind.

    Args:
        table: one row per run of the design, with ``x`` as it is, or would be.
        pooled_r: the correlation that is there; 0 gives the tests' size instead of their power.
        cluster: columns whose combinations share a part of the noise, ``cluster_share`` of its variance.

    Returns:
        One row per test and alpha: ``test``, ``alpha``, ``estimate`` (the power; for "within": the mean share of
        panels, and "within, Holm": after Holm's correction), ``low``, ``high`` (95 %, of the simulation: Wilson's over
        replicates), ``n`` (runs), ``replicates``, ``pooled_r``, ``noise_sd`` (in units of x).

    Raises:
        SegarError: a column is missing, x does not vary, or a number is out of range.
    """
    require(table, x, *panel, *given, *cluster)
    if not -1 < pooled_r < 1 or not 0 <= cluster_share <= 1:
        raise SegarError(
            f"pooled_r must lie within (-1, 1) and cluster_share in [0, 1]; not {pooled_r}, {cluster_share}"
        )
    a = table[x].to_numpy(np.float64)
    if np.ptp(a) == 0:
        raise SegarError(f"'{x}' does not vary in this design")
    spread = float(a.std())
    sd = spread * math.sqrt(1 / pooled_r**2 - 1) if pooled_r else spread
    noise = rng.normal(size=(len(a), replicates)) * math.sqrt(1 - cluster_share)
    if cluster:
        names, place = np.unique(labels(table, cluster), return_inverse=True)
        noise += rng.normal(size=(len(names), replicates))[place] * math.sqrt(cluster_share)
    y = np.sign(pooled_r) * a[:, None] + sd * noise
    found = p_values(table, a, y, panel, given)
    rows = []
    for alpha in alphas:
        for test, p in found.items():
            shares = (p < alpha).mean(axis=0) if p.ndim == 2 else (p < alpha).astype(float)
            power = float(shares.mean())
            low, high = np.asarray(proportion_confint(power * replicates, replicates, method="wilson"))
            rows.append({"test": test, "alpha": alpha, "estimate": power, "low": float(low), "high": float(high)})
    return pd.DataFrame(rows).assign(n=len(a), replicates=replicates, pooled_r=pooled_r, noise_sd=sd)


def p_values(
    table: pd.DataFrame, a: Floats, y: Floats, panel: Sequence[str], given: Sequence[str]
) -> dict[str, Floats]:
    """p of each test for each column of ``y`` [n, replicates]; of the panels [panels, replicates]."""
    names = labels(table, panel)
    panels = indicators(list(names))
    one = np.ones((len(a), 1))
    tests = {"pooled": one, "given panel": np.column_stack([one, panels])}
    if given:
        covariates_text = " and ".join(f"log {name}" for name in given)
        tests[f"given panel and {covariates_text}"] = np.column_stack(
            [one, panels, covariate_matrix(table, given, True)]
        )
    found = {test: partial_p(a, y, design) for test, design in tests.items()}
    parts = [np.flatnonzero(names == name) for name in np.unique(names)]
    within = [partial_p(a[rows], y[rows], one[rows]) for rows in parts if len(rows) > 2 and np.ptp(a[rows]) > 0]
    if within:
        found["within"] = np.stack(within)
        found["within, Holm"] = holm(found["within"])
    return found


def partial_p(a: Floats, y: Floats, design: Floats) -> Floats:
    """Two-sided p of the partial correlation of ``a`` [n] with each column of ``y`` [n, m] given ``design`` [n, k]."""
    basis = np.linalg.qr(design)[0][:, : np.linalg.matrix_rank(design)]
    a, y = a - basis @ (basis.T @ a), y - basis @ (basis.T @ y)
    freedom = len(a) - basis.shape[1] - 1
    if freedom < 1:
        return np.ones(y.shape[1])
    r = a @ y / (np.linalg.norm(a) * np.linalg.norm(y, axis=0))
    t = r * np.sqrt(freedom / np.maximum(1 - r * r, 1e-300))
    return 2 * stats.t.sf(np.abs(t), freedom)


def points_needed(rho: float, power: float = 0.8, alpha: float = ALPHA) -> int:
    """Independent points for a two-sided test of a correlation ``rho`` to have that power (Fisher's z); 4 at least."""
    if not 0 < abs(rho) < 1:
        raise SegarError(f"rho must lie strictly between 0 and 1 in size, not {rho}")
    z = stats.norm.isf(alpha / 2) + stats.norm.ppf(power)
    return max(4, math.ceil(3 + (z / math.atanh(abs(rho))) ** 2))


def critical_r(n: int, alpha: float = ALPHA, covariates: int = 0) -> float:
    """The smallest |r| of ``n`` points that has p < ``alpha``, given so many covariates."""
    freedom: Any = n - 2 - covariates
    if freedom < 1:
        raise SegarError(f"{n} points are too few for {covariates} covariates")
    t = float(stats.t.isf(alpha / 2, freedom))
    return t / math.sqrt(freedom + t * t)


def detectable_difference(sd: float, n: int, power: float = 0.8, alpha: float = ALPHA) -> float:
    """The smallest difference between the means of two groups of ``n`` with this standard deviation that Student's two-sided
    test finds with that power; NaN of fewer than 2."""
    if n < 2:
        return float("nan")
    size = TTestIndPower().solve_power(nobs1=n, power=power, alpha=alpha, alternative="two-sided")
    return float(size) * sd
