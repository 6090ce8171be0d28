"""The designed study: which measure of a training set predicts the gap of sets that were not seen."""

import numpy as np
import pandas as pd

from analysis.report.claims.evidence import Evidence
from analysis.stats.association import labels
from analysis.stats.correlation import indicators
from analysis.tables import Floats, column, keep, mean_by

# Each measure in words, with its column.
MEASURES = {
    "exact W2": "w2_exact",
    "W2 of positions": "w2_position",
    "exact W2 without its floor": "w2_debiased",
    "W2 weighted by parts of the gap": "w2_weighted",
    "covering radius": "radius",
    "effective number": "effective_number",
    "KS": "ks",
}
PARTS = {
    "position": "part_position",
    "properties": "part_properties",
    "rest": "part_types",
}  # groups of the attribution
OUTCOME = "gap_success"


def matched_predictions(evidence: Evidence, runs: pd.DataFrame) -> pd.DataFrame:
    """One row per measure: ``measure``, and what it gains in R² out of sample over family and n, with its interval."""
    table = with_weighted(evidence, evidence.results.with_training_sets(runs))
    rows = []
    for words, name in MEASURES.items():
        if name not in table:
            continue
        part = keep(table, np.isfinite(column(table, name)))
        values = np.column_stack([column(part, OUTCOME), standardised(part, name), base_of(part), block_numbers(part)])
        rows.append(evidence.by_blocks(part, values, gain).row(measure=words))
    return pd.DataFrame(rows)


def with_weighted(evidence: Evidence, table: pd.DataFrame) -> pd.DataFrame:
    """The table with ``w2_weighted``: the parts of squared exact W2, each times its group's part of the gap; without the
    attribution of the gap, as it is."""
    found = evidence.attribution
    if found.empty or "part_position" not in table:
        return table
    means = mean_by(found, ["group"], ["part"])
    parts = dict(zip(means["group"], column(means, "part"), strict=True))
    weights = {group: max(-parts.get(group, 0.0), 0.0) for group in PARTS}
    total = sum(weights.values())
    if not total:
        return table
    square = sum(weights[group] / total * column(table, name) for group, name in PARTS.items())
    return table.assign(w2_weighted=np.sqrt(np.maximum(square, 0.0)))


def standardised(table: pd.DataFrame, name: str) -> Floats:
    """A measure in standard deviations within each family and n, because its scale differs between them."""
    value, cells = column(table, name).copy(), labels(table, ("family", "n"))
    for cell in np.unique(cells):
        rows = cells == cell
        spread = value[rows].std()
        value[rows] = (value[rows] - value[rows].mean()) / (spread if spread > 0 else 1.0)
    return value


def base_of(table: pd.DataFrame) -> Floats:
    """A constant and indicators of family and n: [rows, cells]."""
    return np.column_stack([np.ones(len(table)), indicators(list(labels(table, ("family", "n"))))])


def block_numbers(table: pd.DataFrame) -> Floats:
    """The number of each row's seed of a family, which is predicted as a whole."""
    return np.unique(labels(table, ("family", "seed")), return_inverse=True)[1].astype(np.float64)


def gain(values: Floats) -> float:
    """R² out of sample on outcome (first column) of measure (second) and base (others but the last), less that of the base
    alone; the last column numbers the blocks that are left out in turn."""
    y, measure, base, block = values[:, 0], values[:, 1:2], values[:, 2:-1], values[:, -1]
    wrong = np.zeros(2)
    for one in np.unique(block):
        out = block == one
        for k, x in enumerate((np.column_stack([base, measure]), base)):
            line = np.linalg.lstsq(x[~out], y[~out], rcond=None)[0]
            wrong[k] += float(((y[out] - x[out] @ line) ** 2).sum())
    return 1 - wrong[0] / wrong[1] if wrong[1] else float("nan")
