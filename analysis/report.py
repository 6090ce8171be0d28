"""``python -m analysis.report runs=DIR``: from run folders to the table, the statistics, the figures and a page.

It reads nothing but run folders, so it can be repeated at any time and anywhere. Files are replaced whole, and the same
runs give the same bytes.
"""

from __future__ import annotations

import dataclasses
import json
import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import pandas as pd
from omegaconf import DictConfig

from analysis.figures import gap_against_w2, gap_by_family, save_figure
from analysis.gap import gap_statistics, log_n_statistics
from analysis.page import page
from analysis.stats.correlation import Correlation, NotAvailable
from analysis.tables import Grid, Missing, Run, find_runs, missing_cells, read_runs, select, write_csv
from analysis.words import in_words
from experiments.atomic import write_text
from experiments.cells import design
from experiments.config import TrackingConfig, as_data, require
from experiments.construct import construct
from experiments.entry import plain, run_command
from experiments.errors import RunFolderError
from experiments.mlflow_store import open_store
from experiments.run_folder import CHECKOUT
from segar.errors import did_you_mean

TABLE = "gap_vs_w2.csv"
HEADLINE = "gap_vs_w2"
BY_FAMILY = "gap_vs_w2_by_family"
STATISTICS = "statistics.json"
PAGE = "report.md"


@dataclass(frozen=True)
class ReportConfig:
    """Which runs are reported, and what is expected of them."""

    runs: str | None = None  # where the run folders lie; None: runs/ of the checkout
    out: str | None = None  # where the report goes; None: reports/<design> under runs
    design: str | None = None  # of the runs to report, where there are several
    families: tuple[str, ...] = ()  # the cells that should be there; empty: those of the runs found
    difficulties: tuple[str, ...] = ()
    counts: tuple[int, ...] = ()
    seeds: tuple[int, ...] = ()
    action_mode: str = "deterministic"  # of the evaluation episodes in figures and statistics; the table has both
    distances: tuple[str, ...] = ("reference", "exact")
    tracking: TrackingConfig = field(default_factory=TrackingConfig)

    def __post_init__(self) -> None:
        require(bool(self.distances), "distances", self.distances, "at least one")

    @property
    def root(self) -> Path:
        """Absolute path of the folder that holds the run folders."""
        return Path(self.runs).expanduser().resolve() if self.runs else CHECKOUT / "runs"


@dataclass(frozen=True)
class Report:
    """What was written, and what was found missing."""

    folder: Path
    table: pd.DataFrame  # all runs, both action modes
    missing: list[Missing]
    statistics: dict[str, Any]

    @property
    def files(self) -> list[Path]:
        """All files of the report, tables and figures first."""
        figures = [f"{name}{suffix}" for name in (HEADLINE, BY_FAMILY) for suffix in (".png", ".pdf")]
        return [self.folder / name for name in (TABLE, *figures, STATISTICS, PAGE)]


def make_report(config: ReportConfig) -> Report:
    """Reads the runs, writes the report's files, and shows it in MLflow.

    Raises:
        RunFolderError: there are no runs, none is finished, or they belong to several experiments.
    """
    found, unreadable = find_runs(config.root)
    runs = choose_design(config, found, unreadable)
    table, unfinished = read_runs(runs)
    if table.empty:
        raise RunFolderError(f"none of the {len(runs)} runs in {config.root} is finished; run the same command again")
    require_columns(table, config.action_mode, config.distances)
    missing = missing_cells(table, expected_grid(config, runs), unfinished)
    folder = Path(config.out).expanduser().resolve() if config.out else config.root / "reports" / runs[0].design
    folder.mkdir(parents=True, exist_ok=True)
    report = write_report(config, table, missing, folder, unreadable)
    track_report(config, report, runs[0].design)
    return report


def choose_design(config: ReportConfig, runs: Sequence[Run], unreadable: dict[Path, str]) -> list[Run]:
    """The runs of the experiment to report; raises :class:`RunFolderError` if which one is unclear."""
    designs = {run.design: run for run in runs}
    if not designs:
        more = (
            f" ({len(unreadable)} cannot be read, for example: {next(iter(unreadable.values()))})" if unreadable else ""
        )
        raise RunFolderError(f"there are no run folders in {config.root}{more}. Train some, or name another runs=...")
    if config.design is not None and config.design not in designs:
        raise RunFolderError(
            f"no run in {config.root} has the design {config.design}.{did_you_mean(config.design, designs)}"
        )
    if config.design is None and len(designs) > 1:
        listed = "\n".join(f"  design={name}: {describe(run)}" for name, run in sorted(designs.items()))
        raise RunFolderError(f"the runs in {config.root} belong to several experiments; choose one:\n{listed}")
    chosen = config.design or next(iter(designs))
    return [run for run in runs if run.design == chosen]


def describe(run: Run) -> str:
    """The settings of a design that tell it from others, in a few words."""
    shared = design(run.config)
    shift = "shifted test levels" if shared["levels"]["shifted"] else "test levels of the same distribution"
    learned = f"{run.config.algorithm.name} on {run.config.observation.name}, {run.config.scale.frames:,} frames"
    return f"{learned}, {shift}, e.g. {run.folder.name}"


def expected_grid(config: ReportConfig, runs: Sequence[Run]) -> Grid:
    """The cells that should be there: as configured, else every combination of what the runs have."""
    cells = [run.cell for run in runs]
    return Grid(
        families=config.families or sorted({cell.family for cell in cells}),
        difficulties=config.difficulties or sorted({cell.difficulty for cell in cells}),
        counts=config.counts or sorted({cell.count for cell in cells}),
        seeds=sorted({*config.seeds, *(cell.seed for cell in cells)}),
    )


def require_columns(table: pd.DataFrame, action_mode: str, distances: Sequence[str]) -> None:
    """Raises :class:`RunFolderError` unless there are episodes in that mode, and every run has every distance."""
    if action_mode not in set(table["action_mode"]):
        near = did_you_mean(action_mode, set(table["action_mode"]))
        raise RunFolderError(f"the runs have no evaluation episodes with action_mode={action_mode}.{near}")
    known = [name.removeprefix("w2_") for name in table if name.startswith("w2_")]
    for mode in distances:
        if mode not in known:
            raise RunFolderError(f"the runs have no W2 in mode '{mode}'.{did_you_mean(mode, known)}")
        without = table.loc[table[f"w2_{mode}"].isna(), "run"]
        if len(without):
            raise RunFolderError(f"the run {without.iloc[0]} has no W2 in mode '{mode}'; choose other distances=[...]")


def write_report(
    config: ReportConfig, table: pd.DataFrame, missing: list[Missing], folder: Path, unreadable: dict[Path, str]
) -> Report:
    """Writes table, figures, statistics and page into ``folder``."""
    chosen = select(table, action_mode=config.action_mode)
    statistics = {
        "runs": len(chosen),
        "runs_expected": len(chosen) + len(missing),
        "action_mode": config.action_mode,
        "missing": [{"cell": str(one.cell), "reason": one.reason} for one in missing],
        "unreadable": {path.name: reason for path, reason in unreadable.items()},
        "code": sorted(set(chosen["code"])),
        "w2": {mode: gap_statistics(chosen, mode) for mode in config.distances},
        "log_n": log_n_statistics(chosen),
    }
    write_csv(folder / TABLE, table)
    save_figure(gap_against_w2(chosen, config.distances, len(missing)), folder / HEADLINE)
    save_figure(gap_by_family(chosen, config.distances), folder / BY_FAMILY)
    write_text(folder / STATISTICS, json.dumps(as_plain(statistics), indent=2, ensure_ascii=False) + "\n")
    write_text(folder / PAGE, page(chosen, statistics, HEADLINE, BY_FAMILY))
    return Report(folder, table, missing, statistics)


def as_plain(value: Any) -> Any:
    """JSON's types; NaN and infinity become null, a statistic that is not available its reason."""
    if isinstance(value, NotAvailable):
        return {"not_available": value.reason}
    if dataclasses.is_dataclass(value) and not isinstance(value, type):
        return as_plain(dataclasses.asdict(value))
    if isinstance(value, dict):
        return {str(key): as_plain(one) for key, one in value.items()}
    if isinstance(value, list | tuple):
        return [as_plain(one) for one in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value


def track_report(config: ReportConfig, report: Report, design_name: str) -> None:
    """Shows the files and the headline numbers in MLflow, as a run of its own; a repeated report replaces it."""
    if config.tracking.name == "none":
        return
    client, experiment = open_store(config.tracking, config.root)
    where = f"tags.kind = 'report' and tags.report_folder = '{report.folder}'"
    for earlier in client.search_runs([experiment], where):
        client.delete_run(earlier.info.run_id)
    tags = {"kind": "report", "report_folder": str(report.folder), "design": design_name}
    run = client.create_run(experiment, run_name=f"report of {report.folder.name}", tags=tags).info.run_id
    for name, value in headline_numbers(report.statistics).items():
        client.log_metric(run, name, value)
    for path in report.files:
        client.log_artifact(run, str(path))
    client.set_terminated(run)


def headline_numbers(statistics: dict[str, Any]) -> dict[str, float]:
    """The pooled correlations per W2 mode and the number of runs, as MLflow metrics."""
    numbers = {"runs": float(statistics["runs"])}
    for mode, found in statistics["w2"].items():
        for place in ("pooled", "within_panel", "given_panel_and_log_n"):
            if isinstance(found[place], Correlation):
                for name in ("pearson", "pearson_p", "spearman", "spearman_p"):
                    numbers[f"{mode}/{place}/{name}"] = getattr(found[place], name)
    return numbers


def main(config: ReportConfig) -> None:
    """Makes the report and says where it is."""
    report = make_report(config)
    chosen = report.statistics["runs"]
    print(f"{chosen} of {chosen + len(report.missing)} runs are in the report.")
    for one in report.missing:
        print(f"  missing: {one.cell}: {one.reason}")
    for mode, found in report.statistics["w2"].items():
        print(f"gap against {mode} W2: {in_words(found['pooled'])}")
    for name, file in (("figure", f"{HEADLINE}.png"), ("table", TABLE), ("report", PAGE)):
        print(f"{name + ':':<8}{report.folder / file}")


def build(config: DictConfig) -> ReportConfig:
    """Hydra's result as settings."""
    return construct(ReportConfig, plain(config), "")


if __name__ == "__main__":
    run_command(main, "report", build, as_data(ReportConfig()))
