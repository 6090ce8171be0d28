"""The statistics that claims, figures and tables share, each computed once, by :mod:`analysis.stats`."""

import dataclasses
import zlib
from collections.abc import Callable, Sequence
from functools import cached_property
from typing import Any

import numpy as np
import pandas as pd

from analysis.report.results import BLOCK, ETA, PANEL, Results, measured
from analysis.stats.association import associations, covariate_matrix
from analysis.stats.attribution import full_factorial, shapley_of_pairs
from analysis.stats.correlation import NotAvailable, correlate, explained, indicators, residuals
from analysis.stats.estimate import Estimate
from analysis.stats.mixed import mixed_model
from analysis.stats.power import power_of_design
from analysis.stats.prediction import left_out
from analysis.stats.resampling import cluster_interval, cosine, permutation_within
from analysis.tables import column, count_of, keep, pick, select
from experiments.levels.mixed_levels import REST, SEPARATOR
from segar.errors import SegarError

BLOCKS, PERMUTATION = "(panel, seed) blocks", "permutation"  # within panels, or within cells
SEED = 2022  # of all bootstraps and permutations
RESAMPLES = 1000
PAPER_R = -0.597  # what p = 1.47e-5 means for 45 points
DISTANCES = {"reference": "W2 of 2022", "exact": "exact W2", "paper": "W2 of Algorithm 1"}
GAPS = {"gap": "full returns", "gap_2022": "returns of 2022", "gap_sampled": "full returns, sampled actions"}
OUTLIERS = {
    "all runs": "kept",
    "without points of |z| ≥ 3, the paper's rule": "removed: points",
    "without |z| ≥ 3 in what panels leave": "removed: residuals",
}
GIVEN_CELL = "given cell"
GIVEN = {"pooled": (), "given panel": ("panel",), "given panel and log n": ("panel", "log_n"), GIVEN_CELL: ("cell",)}


class Evidence:
    """Statistics of a results folder, by name; the same name always draws the same random numbers."""

    def __init__(self, results: Results):
        self.results = results

    @property
    def main(self) -> pd.DataFrame:
        """The main grid."""
        return self.results.main

    @cached_property
    def modes(self) -> list[str]:
        """The W2 modes that all runs of the main grid have; the one of 2022 first."""
        known = [m for m in DISTANCES if f"w2_{m}" in self.main]
        return [m for m in known if np.isfinite(column(self.main, f"w2_{m}")).all()]

    @cached_property
    def associations(self) -> pd.DataFrame:
        """:func:`analysis.stats.association.associations` of the main grid for every W2 mode and kind of gap."""
        parts = [
            associations(self.main, f"w2_{mode}", gap).assign(w2=mode, gap=gap) for mode in self.modes for gap in GAPS
        ]
        return leading(pd.concat(parts, ignore_index=True), "w2", "gap") if parts else pd.DataFrame()

    def association(
        self, mode: str, gap: str, test: str, panel: str = "", method: str = "pearson", outliers: str = "kept",
        corrected: bool = False,
    ) -> Estimate:  # fmt: skip
        """One row of :attr:`associations`; with Holm's p if ``corrected``."""
        table = self.associations
        want = {"w2": mode, "gap": gap, "test": test, "panel": panel, "method": method, "outliers": outliers}
        rows = select(table, **want) if len(table) else table
        if rows.empty:
            return Estimate.missing(0, "no such runs")
        row = rows.iloc[0].to_dict()
        found = Estimate.of_row(row)
        return dataclasses.replace(found, p=float(row["p_holm"])) if corrected else found

    def by_blocks(
        self, name: str, table: pd.DataFrame, values: np.ndarray, statistic: Callable[[np.ndarray], float],
        clusters: Sequence[str] = BLOCK, correlation: bool = False,
    ) -> Estimate:  # fmt: skip
        """A statistic of ``values`` [rows, columns], with the interval and p of
        :func:`analysis.stats.resampling.cluster_interval`, for which clusters of the table's rows stay together."""
        if table.empty:
            return Estimate.missing(0, "no such runs")
        found, way = cluster_interval(
            table, statistic, clusters, self.rng(name), values=values, correlation=correlation, resamples=RESAMPLES
        )
        return dataclasses.replace(
            found, note=found.note or f"{len(table)} rows in {found.n} blocks, {way}", n=len(table)
        )

    def correlation(self, name: str, table: pd.DataFrame, x: str, y: str, given: Sequence[str] = ()) -> Estimate:
        """Pearson's r of two columns given others, with the interval and p of (panel, seed) blocks."""
        whole = pearson(table, x, y, given)
        if not np.isfinite(whole.estimate):
            return whole
        values = np.column_stack([column(table, x), column(table, y), design(table, given)])
        return self.by_blocks(name, table, values, partial, correlation=True)

    def permutation(self, name: str, table: pd.DataFrame, x: str, y: str, test: str = "given panel") -> Estimate:
        """:func:`analysis.stats.resampling.permutation_within`, given what a test in :data:`GIVEN` gives; where nothing can
        be permuted, none and the reason."""
        given = ("n",) if "log_n" in GIVEN[test] else ()
        within = ("cell",) if test == GIVEN_CELL else ("panel",)
        try:
            return permutation_within(table, x, y, self.rng(name), within=within, given=given, resamples=RESAMPLES)
        except SegarError as error:
            return Estimate.missing(len(table), str(error))

    def mean(self, name: str, table: pd.DataFrame, value: str = "difference") -> Estimate:
        """The mean of a column, such as paired differences, with the interval and p of (panel, seed) blocks."""
        return self.by_blocks(name, table, column(table, value), lambda values: float(values.mean()))

    @cached_property
    def resampled(self) -> pd.DataFrame:
        """Correlations of gap and W2 in the main grid, by what is given: with intervals of blocks and a permutation."""
        rows = []
        for mode in self.modes:
            for test, given in GIVEN.items():
                for gap in ("gap", "gap_2022"):
                    base: dict[str, Any] = {"w2": mode, "gap": gap, "test": test}
                    what = (f"{mode} {gap} {test}", self.main, f"w2_{mode}", gap)
                    rows.append(self.correlation(*what, given).row(**base, way=BLOCKS))
                    if given:
                        rows.append(self.permutation(*what, test).row(**base, way=PERMUTATION))
        return pd.DataFrame(rows)

    @cached_property
    def mixed(self) -> pd.DataFrame:
        """The primary analysis: mixed models of the gap, with and without log n; slopes per standard deviation."""
        rows = []
        seeds = ("seed",) if count_of(self.main, "seed") > 1 else ()
        for mode in self.modes:
            for gap in ("gap", "gap_2022"):
                for x, log in (([f"w2_{mode}"], []), ([f"w2_{mode}", "n"], ["n"])):
                    base = {"w2": mode, "gap": gap, "model": f"gap ~ {' + '.join(['W2', *(['log n'] if log else [])])}"}
                    try:
                        model = mixed_model(self.main, gap, x, (PANEL, *seeds), log=log, standardise=True)
                    except SegarError as error:
                        rows.append(Estimate.missing(len(self.main), str(error)).row(**base, term=f"w2_{mode}"))
                        continue
                    fixed = keep(model.fixed, model.fixed["term"] != "intercept")
                    rows += [{**base, **row, "note": row["note"] or model.note} for row in fixed.to_dict("records")]
        return pd.DataFrame(rows)

    @cached_property
    def sensitivity(self) -> pd.DataFrame:
        """The headline and its corrected partial form, when choices of the analysis change."""
        rows = []
        for mode, gap, test in (("reference", "gap_2022", "pooled"), ("exact", "gap", "given panel and log n")):
            base = {"w2": mode, "gap": gap, "test": test}
            for change, rule in OUTLIERS.items():
                rows.append(self.association(mode, gap, test, outliers=rule).row(change=change, **base))
            rank = self.association(mode, gap, test, method="spearman")
            rows.append(rank.row(change="Spearman's ρ in place of r", **base))
            many = keep(self.main, self.main["n"] > 1)
            if len(many):
                found = pearson(many, f"w2_{mode}", gap, GIVEN[test])
                rows.append(found.row(change="without the runs with one training level", **base))
            sampled = self.association(mode, "gap_sampled", test)
            rows.append(sampled.row(change="sampled actions, full returns", **{**base, "gap": "gap_sampled"}))
        return pd.DataFrame(rows)

    @cached_property
    def explained(self) -> pd.DataFrame:
        """R² of log W2 on panel, on log n, and on both, per mode: is W2 more than how many levels there are?"""
        panel, log_n = indicators(list(self.main["panel"])), self.main[["log_n"]].to_numpy(np.float64)
        rows = []
        for mode in self.modes:
            y = np.log(column(self.main, f"w2_{mode}"))
            for name, x in (("panel", panel), ("log n", log_n), ("both", np.column_stack([panel, log_n]))):
                found = explained(y, x)
                rows.append({"w2": mode, "of": name, "r2": np.nan if isinstance(found, NotAvailable) else found})
        return pd.DataFrame(rows)

    @cached_property
    def predictors(self) -> pd.DataFrame:
        """How well the gap of a panel that was left out is predicted, from W2, log n and means of difficulties."""
        sets = {f"W2, {mode}": [f"w2_{mode}"] for mode in self.modes} | {"log n": ["log_n"]}
        sets |= {f"W2, {mode}, and log n": [f"w2_{mode}", "log_n"] for mode in self.modes}
        return left_out(self.main, "gap", sets, PANEL)

    @cached_property
    def attribution(self) -> pd.DataFrame:
        """The part of the gap that each group of factors adds: ``group`` and ``part`` (in units of return).

        One row per group and run, beside the columns of the run. Runs without all combinations are left out.
        """
        between = self.results.between
        if between.empty:
            return pd.DataFrame()
        runs = {row["run"]: row for row in measured(self.results.runs).to_dict("records")}
        parts = []
        for _, tests in between.groupby(["run", "test_groups"], sort=True):
            run, names = (tests[name].iloc[0] for name in ("run", "test_groups"))
            groups = [*str(names).split(SEPARATOR), REST]
            played = {frozenset(str(changed).split(SEPARATOR)): value
                      for changed, value in zip(tests["test_changed"], column(tests, ETA), strict=True)}  # fmt: skip
            if run not in runs or len(played) != 2 ** len(groups) - 2:
                continue
            of_run = runs[run]
            played |= {frozenset(): of_run["eta_train_deterministic"], frozenset(groups): of_run[ETA]}
            table = full_factorial(groups).assign(pair=0)
            changed = ([name for name in groups if row[name]] for row in table.to_dict("records"))
            found = shapley_of_pairs(table.assign(value=[played[frozenset(one)] for one in changed]), groups).iloc[0]
            parts += [{**of_run, "group": name, "part": float(found[name])} for name in groups]
        return pd.DataFrame(parts)

    @cached_property
    def power(self) -> pd.DataFrame:
        """How often this design would find the paper's effect, if it is as large as the paper's p-value implies.

        No row where W2 does not vary, as with a single run.
        """
        if len(np.unique(column(self.main, "w2_reference"))) < 2:
            return pd.DataFrame({"test": [], "estimate": [], "n": []})
        return power_of_design(self.main, "w2_reference", self.rng("power"), pooled_r=PAPER_R, alphas=(0.05,))

    def rng(self, name: str) -> np.random.Generator:
        """A generator of its own for everything that is drawn, so that leaving a figure out changes no number."""
        return np.random.default_rng([SEED, zlib.crc32(name.encode())])


def partial(values: np.ndarray) -> float:
    """The correlation of the first two columns given the others."""
    left = residuals(values[:, :2], values[:, 2:])
    return cosine(left[:, 0], left[:, 1])


def pearson(table: pd.DataFrame, x: str, y: str, given: Sequence[str] = ()) -> Estimate:
    """Pearson's r given columns (numbers, or names of groups), with Fisher's interval; NaN where there is none."""
    found = correlate(column(table, x), column(table, y), matrix(table, given))
    if isinstance(found, NotAvailable):
        return Estimate.missing(len(table), found.reason)
    return Estimate(found.pearson, found.pearson_low, found.pearson_high, found.points, found.pearson_p)


def matrix(table: pd.DataFrame, given: Sequence[str]) -> np.ndarray | None:
    """Covariates [n, k]: numbers as they are, anything else as indicators; None where there are none."""
    parts = []
    for name in given:
        numeric = pd.api.types.is_numeric_dtype(table[name])
        parts.append(
            covariate_matrix(table, [name], log=False) if numeric else indicators(list(table[name].astype(str)))
        )
    return np.column_stack(parts) if parts else None


def design(table: pd.DataFrame, given: Sequence[str]) -> np.ndarray:
    """What least squares takes out of a column: its mean, and covariates; [n, 1 + k]."""
    covariates = matrix(table, given)
    ones = np.ones((len(table), 1))
    return ones if covariates is None else np.column_stack([ones, covariates])


def leading(table: pd.DataFrame, *names: str) -> pd.DataFrame:
    """The table with these columns first."""
    return pick(table, [*names, *(name for name in table if name not in names)])
