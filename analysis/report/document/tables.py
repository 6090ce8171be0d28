"""The tables of statistics: as CSV files with all digits that mean something, and as the report prints them."""

from collections import Counter
from collections.abc import Callable, Mapping, Sequence

import numpy as np
import pandas as pd

from segar.analysis.plotting.names import panel_name
from segar.analysis.report.captions import TABLES
from segar.analysis.report.claims.evidence import BLOCKS, DISTANCES, GAPS, PERMUTATION, Evidence
from segar.analysis.report.claims.prediction import matched_predictions
from segar.analysis.report.claims.scores import comparison
from segar.analysis.report.claims.specifications import specifications
from segar.analysis.report.document.blocks import Table
from segar.analysis.report.number_format import effect, effect_of_r, p_value, plain, signed
from segar.analysis.report.results import PANEL
from segar.analysis.report.rules import GATE_MARGIN
from segar.analysis.stats.estimate import Estimate
from segar.analysis.tables import column, count_of, mean_by, pick, select

LEARNED_FROM = "success_train_deterministic"  # what the gate looks at
CELL_COLUMNS = (
    "w2_reference", "w2_exact", "eta_train_deterministic", "eta_test_deterministic", "gap", "gap_se", "gap_2022",
    "success_train_deterministic", "success_test_deterministic", "death_test_deterministic",
)  # fmt: skip


def statistics(evidence: Evidence) -> dict[str, pd.DataFrame]:
    """All tables of statistics, by the name of their CSV file."""
    if evidence.main.empty:
        return {}
    matched = evidence.results.of("matched_sets")
    compared = comparison(evidence.all_results)
    return {
        **({"predictions": matched_predictions(evidence, matched)} if count_of(matched, "design") > 1 else {}),
        **({"scores": compared} if len(compared) else {}),
        "associations": evidence.associations,
        "resampled": evidence.resampled,
        "mixed_models": evidence.mixed,
        "explained": evidence.explained,
        "predictors": evidence.predictors,
        "specifications": specifications(evidence),
        "cells": cells(evidence.ungated.main),
    }


def cells(main: pd.DataFrame) -> pd.DataFrame:
    """One row per family, difficulty and n: means over seeds."""
    shown = [name for name in CELL_COLUMNS if name in main]
    seeds = main.groupby([*PANEL, "n"], sort=True, dropna=False).size()
    return mean_by(main, [*PANEL, "n"], shown).assign(seeds=np.asarray(seeds))


def frames_of(table: pd.DataFrame) -> str:
    """Numbers of frames, with commas."""
    return ", ".join(f"{n:,}" for n in sorted(set(table["frames"])))


def main_table(evidence: Evidence) -> Table:
    """Pooled and partial correlations, with the interval of blocks and the p of a permutation."""
    by = ["w2", "gap", "test"]
    permuted = select(evidence.resampled, way=PERMUTATION)
    permuted = pick(permuted.assign(permuted=permuted["p"]), [*by, "permuted"])
    found = select(evidence.resampled, way=BLOCKS).merge(permuted, on=by, how="left", validate="1:1")
    return correlation_table(found, {"test": "test"}, "main", permuted="p, permuted")


def correlation_table(found: pd.DataFrame, head: Mapping[str, str], caption: str, **more: str) -> Table:
    """Correlations of W2 and gaps, as printed; ``more`` names columns of further p."""
    rows = [
        [*(str(r[name]) for name in head), DISTANCES[r["w2"]], GAPS[r["gap"]], *effect_of_r(Estimate.of_row(r)),
         *(p_value(r[name]) for name in ("p", *more)), f"{r['n']:.0f}"]
        for r in found.to_dict("records")
    ]  # fmt: skip
    columns = (*head.values(), "distance", "returns", "r", "95 %", "p", *more.values(), "runs")
    return Table(columns, rows, len(head) + 2, TABLES[caption])


def mixed_table(evidence: Evidence) -> Table:
    """Slopes of the mixed models."""
    words = [one if one == "log n" else "W2" for one in evidence.mixed["term"]]
    found = evidence.mixed.replace({"w2": DISTANCES, "gap": GAPS}).assign(term=words)
    head = {"w2": "distance", "gap": "returns", "model": "model", "note": "note", "term": "term"}
    return means_table(found, head, "slope", TABLES["mixed"])


def gate_table(evidence: Evidence) -> Table:
    """How many runs of each panel learned, and what idle and random play reach there."""
    everything = evidence.ungated.main
    idle, chance = (evidence.all_results.player(name, "success") for name in ("idle", "random"))
    counted = Counter(evidence.main["panel"])
    rows = [
        [panel_name(panel), f"{counted[panel]}", f"{len(part)}", plain(float(column(part, LEARNED_FROM).mean())),
         plain(idle.get(panel, np.nan)), plain(chance.get(panel, np.nan))]
        for panel in evidence.ungated.results.panels
        for part in (select(everything, panel=panel),)
    ]  # fmt: skip
    head = ("panel", "runs that learned", "runs", "success on training levels", "idle play", "random play")
    return Table(head, rows, 1, TABLES["gate"].format(margin=GATE_MARGIN))


def means(evidence: Evidence, table: pd.DataFrame, group: Sequence[str], value: str) -> pd.DataFrame:
    """Mean of a column per group, with the interval of blocks."""
    rows = []
    for key, part in table.groupby(list(group), sort=True, dropna=False):
        found = evidence.mean(part, value)
        rows.append(found.row(**dict(zip(group, key if isinstance(key, tuple) else (key,), strict=True))))
    return pd.DataFrame(rows)


def means_table(
    found: pd.DataFrame, group: Mapping[str, str], value: str, caption: str, show: Callable[[float, int], str] = signed
) -> Table:
    """The result of :func:`means`, as printed."""
    rows = [
        [*(str(r[name]) for name in group), *effect(Estimate.of_row(r), show), f"{r['n']:.0f}"]
        for r in found.to_dict("records")
    ]
    return Table((*group.values(), value, "95 %", "runs"), rows, len(group), caption)


def row_of(table: pd.DataFrame, **equal: str) -> Estimate:
    """The estimate in the row that has these values; NaN where there is none."""
    rows = select(table, **equal)
    return Estimate.missing(0, "") if rows.empty else Estimate.of_row(rows.iloc[0].to_dict())
