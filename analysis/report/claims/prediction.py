"""The designed study: which measure of a training set predicts the gap of sets that were not seen."""

import numpy as np
import pandas as pd

from segar.analysis.report.claims.evidence import Evidence
from segar.analysis.stats.association import keys
from segar.analysis.stats.correlation import indicators
from segar.analysis.stats.prediction import gain
from segar.analysis.tables import Floats, column, keep, mean_by

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
# The groups of the attribution.
PARTS = {"position": "part_position", "properties": "part_properties", "rest": "part_types"}
OUTCOME = "gap_success"


def matched_predictions(evidence: Evidence, runs: pd.DataFrame) -> pd.DataFrame:
    """One row per measure: ``measure``, and what it gains in R² out of sample over family and n, with its interval."""
    table = with_weighted(evidence, evidence.results.with_training_sets(runs))
    rows = []
    for words, name in MEASURES.items():
        if name not in table:
            continue
        part = keep(table, np.isfinite(column(table, name)))
        cells = indicators(keys(part, ("family", "n")))
        blocks = keys(part, ("family", "seed"))  # predicted as a whole
        values = np.column_stack([column(part, OUTCOME), standardised(part, name), blocks, cells])
        found = evidence.by_blocks(part, values, lambda v: gain(v[:, 0], v[:, 1:2], v[:, 3:], v[:, 2]))
        rows.append(found.row(measure=words))
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
    value, cells = column(table, name).copy(), keys(table, ("family", "n"))
    for cell in np.unique(cells):
        rows = cells == cell
        spread = value[rows].std()
        value[rows] = (value[rows] - value[rows].mean()) / (spread if spread > 0 else 1.0)
    return value
