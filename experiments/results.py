"""A table of runs: ``python -m experiments.results``, or ``sweep=NAME`` for those of one sweep.

One line per run: the settings in which these runs differ, its state, its final figures, and what it was computed with.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

from experiments.commands.hydra_app import run_simple_command
from experiments.runs.journal import read_journal
from experiments.runs.run_folder import (
    VERSIONS,
    is_finished,
    is_locked,
    read_config,
    read_summary,
    read_versions,
    root_folder,
    run_folders,
)
from experiments.runs.versions import computed_with
from experiments.settings import RunConfig, RunFolderError, flat
from segar.cli import table

FIGURES = {  # figures of a summary, and their names in the table
    "evaluation/train/return/deterministic": "train return",
    "evaluation/test/return/deterministic": "test return",
    "evaluation/gap/deterministic": "gap",
    "evaluation/test/success/deterministic": "test success",
}
ALWAYS = ("levels.train", "algorithm.name")  # settings that are shown even where all runs have the same value
DERIVED = ("algorithm.type",)  # settings that follow from others


@dataclass(frozen=True)
class ResultsConfig:
    """Which runs."""

    root: str | None = None  # the folder that holds the run folders; None: runs/ of the checkout
    sweep: str | None = None  # those with this tracking.sweep; None: all


def results(config: ResultsConfig, say: Callable[[str], None] = print) -> None:
    """Prints the table; raises :class:`RunFolderError` if there is no such run."""
    root = root_folder(config.root)
    found = [(folder, read_config(folder)) for folder in run_folders(root)]
    chosen = [(folder, run) for folder, run in found if config.sweep in (None, run.tracking.sweep)]
    if not chosen:
        sweeps = sorted({run.tracking.sweep for _, run in found if run.tracking.sweep})
        known = f"; there are the sweeps {', '.join(sweeps)}" if sweeps else ""
        raise RunFolderError(
            f"there is no run{f' of the sweep {config.sweep}' if config.sweep else ''} in {root}{known}"
        )
    say(as_table(chosen))


def as_table(runs: Sequence[tuple[Path, RunConfig]]) -> str:
    """One line per run folder and its settings."""
    settings = [flat(run.identity()) for _, run in runs]
    names = [name for name in dict.fromkeys(name for one in settings for name in one) if name not in DERIVED]
    varied = [name for name in names if name in ALWAYS or len({str(one.get(name)) for one in settings}) > 1]
    rows = []
    for (folder, _), one in zip(runs, settings, strict=True):
        summary = read_summary(folder) if is_finished(folder) else {}
        rows.append([*(one.get(name) for name in varied), state_of(folder), *(summary.get(key) for key in FIGURES)])
    made = [computed_with(read_versions(folder)) if (folder / VERSIONS).exists() else "" for folder, _ in runs]
    shown = sorted({*made} - {""})
    if len(shown) > 1:
        rows = [[*row, how] for row, how in zip(rows, made, strict=True)]
        return table([*varied, "state", *FIGURES.values(), "computed with"], rows)
    closing = f"\ncomputed with {shown[0]}" if shown else ""
    return f"{table([*varied, 'state', *FIGURES.values()], rows)}{closing}"


def state_of(folder: Path) -> str:
    """The state of a run: finished, at work, stopped or failed (after so many frames), or cut off."""
    if is_finished(folder):
        return "finished"
    if is_locked(folder):
        return "at work"
    journal = read_journal(folder)
    last = journal[-1] if journal else {"event": "not begun"}
    word = "cut off" if last["event"] in ("started", "lost") else last["event"]
    return f"{word} after {last['frames']:,} frames" if last.get("frames") else word


if __name__ == "__main__":
    run_simple_command(results, ResultsConfig, __doc__)
