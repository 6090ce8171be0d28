"""The statistics that claims, figures and tables share, each computed once, by :mod:`segar.analysis.stats`."""

import dataclasses
import zlib
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from itertools import product
from typing import Any

import numpy as np
import pandas as pd

from segar.analysis.report.results import BLOCK, ETA, PANEL, Results, measured
from segar.analysis.report.rules import LEAST_BLOCKS
from segar.analysis.stats.association import associations, labels
from segar.analysis.stats.attribution import full_factorial, shapley_of_pairs
from segar.analysis.stats.correlation import correlate, explained, indicators
from segar.analysis.stats.estimate import Estimate
from segar.analysis.stats.mixed import mixed_model
from segar.analysis.stats.prediction import left_out
from segar.analysis.stats.resampling import by_blocks, partial, permutation_of_blocks
from segar.analysis.tables import column, count_of, keep, select
from segar.errors import SegarError
from segar.experiments.reproduction.grid import compares_panels
from segar.levels import REST, SEPARATOR

BLOCKS, PERMUTATION = "blocks", "permutation"  # of whole blocks within panels
SEED = 2022  # of all permutations
RESAMPLES = 1000
DISTANCES = {"reference": "W2 of 2022", "exact": "exact W2", "paper": "W2 of Algorithm 1"}
GAPS = {"gap": "full returns", "gap_2022": "returns of 2022", "gap_success": "success"}
GIVEN_CELL = "given cell"
GIVEN = {"pooled": (), "given panel": ("panel",), "given panel and n": ("panel", "levels"), GIVEN_CELL: ("cell",)}


@dataclass(frozen=True, eq=False)
class Evidence:
    """Statistics of the runs that learned their training levels, or of all runs."""

    all_results: Results
    gated: bool = True  # leave out the runs below the gate (``analysis/report/rules.yaml``)
    least_blocks: int = LEAST_BLOCKS  # that an interval is given of
    blocks: Mapping[tuple[str, ...], str] = field(default_factory=lambda: {BLOCK: "blocks", PANEL: "blocks"})
    """What blocks of these columns are called where there are too few."""

    @cached_property
    def results(self) -> Results:
        """The tables of the runs that count."""
        return self.all_results.gated if self.gated else self.all_results

    @cached_property
    def ungated(self) -> "Evidence":
        """The same with all runs."""
        return dataclasses.replace(self, gated=False)

    @cached_property
    def modes(self) -> list[str]:
        """The W2 modes that all runs of the main grid have; the one of 2022 first."""
        known = [m for m in DISTANCES if f"w2_{m}" in self.results.main]
        return [m for m in known if np.isfinite(column(self.results.main, f"w2_{m}")).all()]

    @cached_property
    def associations(self) -> pd.DataFrame:
        """:func:`segar.analysis.stats.association.associations` of the main grid for every W2 mode and kind of gap."""
        asked = list(product(self.modes, GAPS))
        parts = [associations(self.results.main, f"w2_{mode}", gap) for mode, gap in asked]
        return pd.concat(parts, keys=asked, names=["w2", "gap"]).reset_index(["w2", "gap"]).reset_index(drop=True)

    def by_blocks(
        self, table: pd.DataFrame, values: np.ndarray, statistic: Callable[[np.ndarray], float],
        clusters: tuple[str, ...] = BLOCK, correlation: bool = False,
    ) -> Estimate:  # fmt: skip
        """A statistic of ``values`` [rows, columns], with the interval and p of leaving out one block of the table's rows at a
        time; no interval where there are fewer blocks than the rules ask for."""
        if table.empty:
            return Estimate.missing(0, "no such runs")
        called = self.blocks.get(clusters, "blocks")
        found = by_blocks(table, statistic, clusters, self.least_blocks, called, values=values, correlation=correlation)
        return dataclasses.replace(found, note=found.note or f"{len(table)} rows in {found.n} blocks", n=len(table))

    def correlation(self, table: pd.DataFrame, x: str, y: str, given: Sequence[str] = ()) -> Estimate:
        """Pearson's r of two columns given others, with the interval and p of the blocks of :func:`clusters_given`."""
        whole = pearson(table, x, y, given)
        if not np.isfinite(whole.estimate):
            return whole
        values = np.column_stack([column(table, x), column(table, y), design(table, given)])
        return self.by_blocks(table, values, partial, clusters_given(table, given), correlation=True)

    def permutation(self, name: str, table: pd.DataFrame, x: str, y: str, given: Sequence[str]) -> Estimate:
        """:func:`segar.analysis.stats.resampling.permutation_of_blocks` within panels; where nothing can be permuted, none and
        the reason. The same ``name`` always draws the same permutations."""
        rng = np.random.default_rng([SEED, zlib.crc32(name.encode())])
        try:
            return permutation_of_blocks(table, x, y, design(table, given), rng, resamples=RESAMPLES)
        except SegarError as error:
            return Estimate.missing(len(table), str(error))

    def slope(
        self, table: pd.DataFrame, x: str, y: str, given: Sequence[str], clusters: tuple[str, ...] = BLOCK
    ) -> Estimate:
        """The slope of ``y`` on ``x`` in least squares given other columns, with the interval and p of blocks."""
        values = np.column_stack([column(table, y), design(table, given), column(table, x)])
        # The slope of the last column, in least squares of the first on all others.
        return self.by_blocks(table, values, lambda v: np.linalg.lstsq(v[:, 1:], v[:, 0], rcond=None)[0][-1], clusters)

    def mean(self, table: pd.DataFrame, value: str = "difference") -> Estimate:
        """The mean of a column, such as paired differences, with the interval and p of blocks."""
        return self.by_blocks(table, column(table, value), lambda values: float(values.mean()))

    @cached_property
    def resampled(self) -> pd.DataFrame:
        """Correlations of gap and W2 in the main grid, by what is given: with intervals of blocks and a permutation."""
        rows = []
        for mode, (test, given), gap in product(self.modes, GIVEN.items(), ("gap", "gap_2022")):
            base: dict[str, Any] = {"w2": mode, "gap": gap, "test": test}
            found = self.correlation(self.results.main, f"w2_{mode}", gap, given)
            rows.append(found.row(**base, way=BLOCKS))
            if given:
                what = (f"{mode} {gap} {test}", self.results.main, f"w2_{mode}", gap, given)
                rows.append(self.permutation(*what).row(**base, way=PERMUTATION))
        return pd.DataFrame(rows)

    def of_main(self, mode: str, gap: str, test: str) -> Estimate:
        """The row of :attr:`resampled` with the interval of blocks."""
        rows = select(self.resampled, w2=mode, gap=gap, test=test, way=BLOCKS) if self.modes else pd.DataFrame()
        return Estimate.of_row(rows.iloc[0].to_dict()) if len(rows) else Estimate.missing(0, "no such runs")

    @cached_property
    def mixed(self) -> pd.DataFrame:
        """The primary analysis: mixed models of the gap, with and without log n; slopes per standard deviation."""
        rows = []
        seeds = ("seed",) if count_of(self.results.main, "seed") > 1 else ()
        for mode, gap, log in product(self.modes, ("gap", "gap_2022"), ([], ["n"])):
            base = {"w2": mode, "gap": gap, "model": "gap ~ W2 + log n" if log else "gap ~ W2"}
            x = [f"w2_{mode}", *log]
            try:
                model = mixed_model(self.results.main, gap, x, (PANEL, *seeds), log=log, standardise=True)
            except SegarError as error:
                rows.append(Estimate.missing(len(self.results.main), str(error)).row(**base, term=f"w2_{mode}"))
                continue
            fixed = keep(model.fixed, model.fixed["term"] != "intercept")
            rows += [{**base, **row, "note": row["note"] or model.note} for row in fixed.to_dict("records")]
        return pd.DataFrame(rows)

    @cached_property
    def explained(self) -> pd.DataFrame:
        """R² of log W2 on panel, on log n, and on both, per mode: is W2 more than how many levels there are?"""
        panel, log_n = indicators(list(self.results.main["panel"])), self.results.main[["log_n"]].to_numpy(np.float64)
        rows = []
        for mode in self.modes:
            y = np.log(column(self.results.main, f"w2_{mode}"))
            for name, x in (("panel", panel), ("log n", log_n), ("both", np.column_stack([panel, log_n]))):
                rows.append({"w2": mode, "of": name, "r2": explained(y, x)})
        return pd.DataFrame(rows)

    @cached_property
    def predictors(self) -> pd.DataFrame:
        """How well the gap of a panel that was left out is predicted, from W2, log n and means of difficulties."""
        sets = {f"W2, {mode}": [f"w2_{mode}"] for mode in self.modes} | {"log n": ["log_n"]}
        sets |= {f"W2, {mode}, and log n": [f"w2_{mode}", "log_n"] for mode in self.modes}
        return left_out(self.results.main, "gap", sets, PANEL)

    @cached_property
    def attribution(self) -> pd.DataFrame:
        """The part of the gap that each group of factors adds: ``group`` and ``part`` (in units of return).

        One row per group and run, beside the columns of the run. Runs without all combinations are left out.
        """
        between, asked = self.results.between, self.results.of("attribution", "figure_3a")["run"]
        between = keep(between, between["run"].isin(list(asked)))
        runs = {row["run"]: row for row in measured(self.results.runs).to_dict("records")}
        parts = []
        for _, tests in between.groupby(["run", "test_groups"], sort=True, dropna=False):
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


def clusters_given(table: pd.DataFrame, given: Sequence[str]) -> tuple[str, ...]:
    """The columns that make up a block of a correlation: a whole panel where panels are compared, because no column that is
    given tells several of them apart; else a panel and a seed. Numbers that are given tell no panels apart."""
    names = (table[name].astype(str) for name in given if not pd.api.types.is_numeric_dtype(table[name]))
    return PANEL if compares_panels(labels(table, PANEL), names) else BLOCK


def pearson(table: pd.DataFrame, x: str, y: str, given: Sequence[str] = ()) -> Estimate:
    """Pearson's r given columns (numbers, or names of groups), with Fisher's interval; NaN where there is none."""
    return correlate(column(table, x), column(table, y), matrix(table, given)).pearson


def matrix(table: pd.DataFrame, given: Sequence[str]) -> np.ndarray:
    """Covariates [n, k]: numbers as they are, anything else as indicators."""
    parts = [np.empty((len(table), 0))]
    for name in given:
        numeric = pd.api.types.is_numeric_dtype(table[name])
        parts.append(column(table, name) if numeric else indicators(list(table[name].astype(str))))
    return np.column_stack(parts)


def design(table: pd.DataFrame, given: Sequence[str]) -> np.ndarray:
    """What least squares takes out of a column: its mean, and covariates; [n, 1 + k]."""
    return np.column_stack([np.ones(len(table)), matrix(table, given)])
