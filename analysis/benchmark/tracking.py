"""A row in MLflow: a run of its own with what the row achieves on each axis and suite, beside its training runs."""

from collections.abc import Mapping, Sequence
from pathlib import Path

import pandas as pd

from segar.analysis.benchmark.scores import FIGURES
from segar.analysis.tables import mean_by, select
from segar.experiments.benchmarking.row import Row
from segar.experiments.settings import TrackingConfig, flat
from segar.experiments.tracking.mlflow_store import replace_run
from segar.experiments.tracking.mlflow_sync import VALUE_LENGTH


def track_row(
    tracking: TrackingConfig, root: Path, row: Row, numbers: Mapping[str, float], files: Sequence[Path]
) -> None:
    """Writes a row's numbers and files to the store of ``root``, in place of those of an earlier report of this row.

    The run has the tag ``kind = 'row'``, and the tag ``sweep`` of the row's training runs.

    Raises:
        TrackingError: the store cannot be opened, or refuses.
    """
    name = row.method.name
    tags = {"kind": "row", "row_folder": str(row.folder), "row_hash": row.hash, "sweep": name, "title": row.method.says}
    parameters = {key: str(value)[:VALUE_LENGTH] for key, value in flat(row.method.settings).items()}
    replace_run(
        tracking, root, f"row {name}", tags, "row_folder",
        metrics=numbers, files=dict.fromkeys(files), parameters=parameters,
    )  # fmt: skip


def numbers_of(name: str, table: pd.DataFrame, board: pd.DataFrame) -> dict[str, float]:
    """``score/<axis>`` and ``test_success/<axis>`` of a row, interquartile means, and its means on each suite by seeds, such as
    ``regret/place-few-v1``; the axis ``all`` is the mean of all."""
    found = {
        f"{line['quantity']}/{line['axis']}": line["estimate"] for line in select(board, row=name).to_dict("records")
    }
    for line in mean_by(select(table, row=name), ["suite"], FIGURES).to_dict("records"):
        found |= {f"{figure}/{line['suite']}": line[figure] for figure in FIGURES if pd.notna(line[figure])}
    return {key: float(value) for key, value in found.items()}
