"""A table of runs: ``segar runs root=FOLDER``, or ``sweep=NAME`` for those of one sweep.

One line per run: the settings in which these runs differ, its state, its final figures, and what it was computed with
where that differs. Below it, the means of runs that differ by their seeds alone, with intervals over level sets, and a
warning where the runs were made by different code. ``output=runs.csv`` (or ``.parquet``, or ``.md``) writes all figures to
a file, and the means with their intervals into ``runs.means.csv`` (or ``.parquet``) beside it; a file ``.md`` has both.
"""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import pyarrow as pa
import pyarrow.csv
import pyarrow.parquet

from segar.cli import table
from segar.experiments.commands.command_line import run_from_command_line
from segar.experiments.commands.plugin import SUMMARIES, find_plugin
from segar.experiments.runs.files import absolute_path, replacing, write_text
from segar.experiments.runs.run_folder import RESULTS, root_folder
from segar.experiments.runs.run_rows import (
    FINISHED,
    RunRow,
    as_columns,
    chosen_rows,
    code_warning,
    copies_warning,
    in_short,
    named_settings,
    score_warnings,
    seen_warning,
)
from segar.experiments.settings import ConfigError
from segar.support import counted

FORMATS = (".csv", ".parquet", ".md")  # of files that are written
SHOWN = ("levels.train", "algorithm.name")  # settings that are printed even where all runs agree
FIGURES = {  # columns that are printed, and their names there; W2 in all modes and the task's own results beside them
    "ks": "KS",
    "gap_deterministic": "gap",
    "success_train_deterministic": "train success",
    "success_test_deterministic": "test success",
    "score_deterministic": "score",
    "regret_deterministic": "regret",
    "eta_train_deterministic": "train return",
    "eta_test_deterministic": "test return",
}


def results(
    root: str | None = None, more: tuple[str, ...] = (), sweep: str | None = None, output: str | None = None
) -> None:
    """Prints the table and what :data:`SUMMARIES` says of it; writes the files that are asked for.

    Args:
        root: the folder that holds the run folders; None: runs/ of the checkout.
        more: further such folders, or single run folders.
        sweep: those with this tracking.sweep; None: all.
        output: a file .csv, .parquet or .md for the rows with all figures; their means go beside it.

    Raises:
        ConfigError: the file has another ending.
        RunFolderError: there is no such run, or the file cannot be written.
    """
    path = absolute_path(output) if output else None
    if path is not None and path.suffix not in FORMATS:
        raise ConfigError(f"output: {output!r} ends in none of {', '.join(FORMATS)}, which say what is written")
    chosen = chosen_rows(map(root_folder, (root, *more)), sweep)
    print(as_table(chosen))
    for row in chosen:
        if row.problem:
            print(f"{row.folder.name}: {row.problem}")
    rows = as_columns(chosen)
    means = path.with_suffix(f".means{path.suffix}") if path is not None and path.suffix != ".md" else None
    averaged = ""
    if any(row.state == FINISHED for row in chosen):
        averaged = find_plugin(SUMMARIES, "default").load()(rows, *([means] if means else []))
    warnings = (copies_warning(chosen), code_warning(chosen), seen_warning(chosen), *score_warnings(chosen))
    summary = "\n\n".join(text for text in (averaged, *warnings) if text)
    if summary:
        print(f"\n{summary}")
    if path is not None:
        write_table(path, rows, summary)
        print(f"\n{counted(len(rows), 'run')} with all figures: {path}")
    if means is not None and averaged:
        print(f"Their means with intervals: {means}")


def as_table(runs: Sequence[RunRow]) -> str:
    """One line per run: what tells the runs apart, their state, and the figures that people read first."""
    rows = as_columns(runs)
    settings = in_short(rows, [name for name in named_settings(runs) if varies(rows, name) or name in SHOWN])
    figures = {name: name for name in rows[0] if name.startswith("w2_")}
    own = (name for name in rows[0] if name.startswith(RESULTS) and name.endswith("_test_deterministic"))
    figures |= FIGURES | {name: name.removesuffix("_deterministic").removeprefix(RESULTS) for name in own}
    shown = {name: title for name, title in figures.items() if any(row.get(name) is not None for row in rows)}
    made = sorted({row["computed_with"] for row in rows} - {""})
    if len(made) > 1:
        shown["computed_with"] = "computed with"
    lines = [[*(row[name] for name in settings), row["state"], *(row[name] for name in shown)] for row in rows]
    closing = [f"computed with {made[0]}"] if len(made) == 1 else []
    return "\n".join([table([*settings, "state", *shown.values()], lines), *closing])


def varies(rows: Sequence[Mapping[str, Any]], name: str) -> bool:
    """Whether a column has several values, runs that cannot be read left out."""
    return len({str(row[name]) for row in rows if row["levels.train"] is not None}) > 1


def write_table(path: Path, rows: Sequence[Mapping[str, Any]], summary: str) -> None:
    """Writes the rows in the format that the file's suffix names, whole or not at all; Markdown with the summary.

    Raises:
        RunFolderError: the file cannot be written; what stood there is untouched.
    """
    if path.suffix == ".md":
        lines = [list(rows[0]), ["---"] * len(rows[0]), *([_cell(value) for value in row.values()] for row in rows)]
        table = "\n".join(f"| {' | '.join(line)} |" for line in lines)
        parts = [table, *(["```text\n" + summary + "\n```"] if summary else [])]
        write_text(path, "\n\n".join(parts) + "\n")
        return
    columns = pa.table({name: _column([row[name] for row in rows]) for name in rows[0]})
    write = pyarrow.csv.write_csv if path.suffix == ".csv" else pyarrow.parquet.write_table
    with replacing(path) as beside:
        write(columns, str(beside))


def _column(values: Sequence[Any]) -> pa.Array:
    """The values of a column; those of several kinds, and lists, as text."""
    kinds = {type(value) for value in values if value is not None}
    if kinds <= {int, float} or kinds in ({bool}, {str}):
        return pa.array(values, pa.float64() if float in kinds else None)
    return pa.array([None if value is None else str(value) for value in values])


def _cell(value: Any) -> str:
    text = f"{value:.6g}" if isinstance(value, float) else "" if value is None else str(value)
    return " ".join(text.replace("|", "\\|").split())


def main() -> None:
    """The command, with what the command line states."""
    run_from_command_line(results)


if __name__ == "__main__":
    main()
