"""Makes tables, figures and the leaderboard page of a folder of rows, and tracks a row in MLflow beside its training runs."""

import re
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

import pandas as pd

from segar.analysis.benchmark.causes import causes_of_rows
from segar.analysis.benchmark.figures import profile_figure, shown_rows
from segar.analysis.benchmark.leaderboard_page import overall_table, page_text, suite_table
from segar.analysis.benchmark.scores import FIGURES, OVERALL, by_name, figures_of, leaderboard, rows_in, suites_compared
from segar.analysis.plotting.figures import save_figure
from segar.analysis.tables import mean_by, select, write_csv
from segar.experiments.benchmarking.panel import PANEL, read_panel
from segar.experiments.benchmarking.protocol import REFERENCES, SHIPPED
from segar.experiments.benchmarking.row import Row
from segar.experiments.benchmarking.verification import is_verified
from segar.experiments.runs.files import write_text
from segar.experiments.runs.run_folder import root_folder
from segar.experiments.settings import TrackingConfig, construct, flat
from segar.experiments.tracking.mlflow_store import replace_run
from segar.experiments.tracking.mlflow_sync import VALUE_LENGTH
from segar.suites import CORE
from segar.support import counted

DIGITS = 6  # of numbers in CSV files
SCORES, BOARD, CAUSES = "scores.csv", "leaderboard.csv", "causes.csv"
MARK = "(not verified)"  # of rows that nobody has played again here
PROFILE, PAGE = "profile", "leaderboard.md"
LINK_UP = re.compile(r"\[([^]]*)\]\(\.\./[^)]*\)")  # to documentation, which lies beside the shipped rows alone


def report_rows(
    folder: Path, row: str = "", tracking: Mapping[str, Any] | None = None, root: str | None = None
) -> None:
    """Write tables, figures and page into a folder of rows, beside which the shipped rows stand; print what the row ``row``
    achieves, and write it to MLflow.

    Rows are compared on the suites of the core where the folder is that of the shipped rows, else on those that rows of the
    folder played.

    Args:
        tracking, root: where results are tracked, see :class:`segar.experiments.settings.TrackingConfig`; None: nowhere.

    Raises:
        SegarError: a row is damaged, or the store of MLflow refuses.
    """
    folder = folder.resolve()
    found = rows_in(dict.fromkeys((folder, SHIPPED)))
    rows = by_name(found)
    causes = causes_of_rows([rows[name] for name in sorted(rows)])
    table = figures_of(found, causes)
    here = [name for name, one in rows.items() if one.folder.parent == folder]
    if folder == SHIPPED:
        names = [name for name in CORE if name in set(table["suite"])]
    else:
        names = [name for one in here if one not in REFERENCES for name in rows[one].suites()]
    suites = suites_compared(table, names or list(table["suite"]))
    board = leaderboard(table, suites)
    marks = {name: f"{name} {MARK}" for name, one in rows.items() if not is_verified(one)}
    if row in rows:
        print(suite_table(table.loc[table["row"] == row]))
        print(with_marks(overall_table(rows, table, board, suites[OVERALL]), marks))
    for name, one in {SCORES: table, BOARD: board, CAUSES: causes}.items():
        write_csv(folder / name, one.replace({"row": marks}) if marks else one, DIGITS)
    if shown := shown_rows(board):
        save_figure(profile_figure(board, shown, list(suites)), folder / PROFILE, (".png",))
    panel = pd.DataFrame(read_panel(folder / PANEL)) if (folder / PANEL).exists() else None
    text = with_marks(page_text(rows, table, board, causes, suites, panel), marks)
    write_text(folder / PAGE, text if folder == SHIPPED else LINK_UP.sub(r"\1", text))
    print(f"{counted(len(here), 'row')} here, {counted(len(rows) - len(here), 'other')}: {folder / PAGE}", flush=True)
    settings = construct(TrackingConfig, tracking or {"name": "none"}, "tracking")
    if row in rows and settings.name != "none":
        files = [path for name in (SCORES, BOARD, CAUSES, PAGE, f"{PROFILE}.png") if (path := folder / name).exists()]
        track_row(settings, root_folder(root), rows[row], numbers_of(row, table, board), files)


def with_marks(text: str, names: Iterable[str]) -> str:
    """A text in which each of these rows says that nobody has verified it."""
    for name in names:
        text = text.replace(f"`{name}`", f"`{name}` {MARK}")
    return text


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
    """``drawn/<axis>``, ``score/<axis>``, ... of a row, its means on each suite over seeds, such as ``regret/place-few-v1``;
    the axis ``all`` is the mean of all but textures."""
    found = {
        f"{line['quantity']}/{line['axis']}": line["estimate"] for line in select(board, row=name).to_dict("records")
    }
    for line in mean_by(select(table, row=name), ["suite"], FIGURES).to_dict("records"):
        found |= {f"{figure}/{line['suite']}": line[figure] for figure in FIGURES if pd.notna(line[figure])}
    return {key: float(value) for key, value in found.items()}
