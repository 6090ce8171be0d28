"""Makes the report of a results folder: claims, statistics, figures with their data, a page and a PDF."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from analysis.collect import PLAN
from analysis.plotting.figures import save_figure
from analysis.report import drawings, drawings_agents, drawings_beyond, verdicts
from analysis.report.claims import CORRECTED, PAPER, Claim, claims_table
from analysis.report.document import Picture
from analysis.report.drawings import Drawn
from analysis.report.evidence import GIVEN, Evidence
from analysis.report.html import page
from analysis.report.pdf import sheets
from analysis.report.results import read_results
from analysis.report.sections import CLAIMS, Drawings, document
from analysis.report.tabulated import statistics
from analysis.tables import write_csv
from experiments.reproduction.imported_results import RUNS
from experiments.runs.files import write_bytes, write_text
from experiments.settings import CHECKOUT, RunFolderError, TrackingConfig, require_known
from experiments.tracking.mlflow_store import calling, open_store

FIGURES: Mapping[str, Callable[[Evidence], Drawn | str]] = {
    "figure_3a": drawings.figure_3a,
    "estimates": drawings.estimates,
    "figure_3b": drawings.figure_3b,
    "train_and_test": drawings.train_and_test,
    "figure_4a": drawings.figure_4a,
    "figure_4b": drawings_agents.figure_4b,
    "figure_5a": drawings_agents.figure_5a,
    "figure_5b": drawings_agents.figure_5b,
    "appendix_mass": drawings_agents.appendix_mass,
    "appendix_sac": drawings_agents.appendix_sac,
    "appendix_measures": drawings_beyond.measures,
    "fixed_n": drawings_beyond.fixed_n,
    "diversity": drawings_beyond.diversity,
    "attribution": drawings_beyond.attribution,
    "rules": drawings_beyond.rules,
    "visual": drawings_beyond.visual,
    "hardness": drawings_beyond.hardness,
    "upper_bound": drawings_beyond.upper_bound,
    "w2_study": drawings_beyond.w2_study,
}
SHIPPED = CHECKOUT / "docs" / "results"
SCALES = ("paper", "standard", "quick", "smoke")  # the largest first
SUFFIXES = (".svg", ".png")
PAGE, SHEETS, VERDICTS = "report.html", "report.pdf", "claims.csv"


@dataclass(frozen=True)
class ReportConfig:
    """Which results, and where the report goes."""

    results: str | None = None  # a folder of tables; None: the largest scale in docs/results
    out: str | None = None  # None: into that folder
    only: tuple[str, ...] = field(
        default_factory=tuple
    )  # names of figures: these alone are drawn, nothing else is made
    tracking: bool = True  # show the report in MLflow, if the results have a plan that says so

    def __post_init__(self) -> None:
        for name in self.only:
            require_known("only", name, list(FIGURES))

    @property
    def folder(self) -> Path:
        """Absolute path of the tables; raises :class:`RunFolderError` if none is named and none is shipped."""
        if self.results is not None:
            return Path(self.results).expanduser().resolve()
        for scale in SCALES:
            if (SHIPPED / scale / RUNS).exists():
                return SHIPPED / scale
        raise RunFolderError(f"there are no results in {SHIPPED}; name a folder of tables: results=FOLDER")

    @property
    def name(self) -> str:
        """The folder as commands in the report name it: from the checkout if it is there, else its own name."""
        folder = self.folder
        return str(folder.relative_to(CHECKOUT)) if folder.is_relative_to(CHECKOUT) else folder.name


@dataclass(frozen=True)
class Report:
    """What was made."""

    folder: Path
    files: list[Path]
    claims: list[Claim]
    evidence: Evidence


def make_report(config: ReportConfig) -> Report:
    """Reads the tables and writes the report; the same tables give the same bytes. Raises :class:`RunFolderError`."""
    evidence = Evidence(read_results(config.folder))
    folder = Path(config.out).expanduser().resolve() if config.out else config.folder
    wanted = {name: draw for name, draw in FIGURES.items() if not config.only or name in config.only}
    drawn = {name: drawing(evidence, folder, name, draw, config.name) for name, draw in wanted.items()}
    files = [
        folder / "figures" / f"{n}{s}"
        for n, one in drawn.items()
        if isinstance(one, Picture)
        for s in (*SUFFIXES, ".csv")
    ]
    if config.only:
        return Report(folder, files, [], evidence)
    claims = [claim(evidence) for claim in CLAIMS]
    written = {folder / "statistics" / f"{name}.csv": table for name, table in statistics(evidence).items()}
    written[folder / VERDICTS] = claims_table(claims)
    for path, table in written.items():
        write_csv(path, table, 4)
    files += written
    text = document(evidence, claims, Drawings(drawn))
    write_text(folder / PAGE, page(text))
    write_bytes(folder / SHEETS, sheets(text))
    files += [folder / PAGE, folder / SHEETS]
    remove_others(folder, files)
    report = Report(folder, files, claims, evidence)
    if config.tracking:
        track(config.folder, report)
    return report


def drawing(
    evidence: Evidence, folder: Path, name: str, draw: Callable[[Evidence], Drawn | str], place: str
) -> Picture | str:
    """Draws a figure and writes its files; or says why it cannot be drawn."""
    found = draw(evidence)
    if isinstance(found, str):
        return found
    svg, png = save_figure(found.figure, folder / "figures" / name, SUFFIXES)
    write_csv(svg.with_suffix(".csv"), found.table, 6)
    command = f"python -m analysis.report results={place} only=[{name}]"
    return Picture(name, found.caption, svg.read_bytes(), png, command)


def remove_others(folder: Path, files: list[Path]) -> None:
    """Removes figures and statistics that an earlier report left and this one does not have."""
    kept = set(files)
    for place in ("figures", "statistics"):
        for path in sorted((folder / place).glob("*")):
            if path.suffix in (*SUFFIXES, ".csv") and path not in kept:
                path.unlink()


def track(results: Path, report: Report) -> None:
    """Shows headline numbers and files in MLflow, as a run of its own; a repeated report replaces it."""
    plan: dict[str, Any] = json.loads((results / PLAN).read_text()) if (results / PLAN).exists() else {}
    if plan.get("tracking", {"name": "none"})["name"] == "none":
        return
    client, experiment = open_store(TrackingConfig(**plan["tracking"]), Path(plan["runs"]))
    where = f"tags.kind = 'report' and tags.report_folder = '{report.folder}'"
    for earlier in calling(client.search_runs, [experiment], where):
        calling(client.delete_run, earlier.info.run_id)
    tags = {"kind": "report", "report_folder": str(report.folder), "scale": report.evidence.results.scale}
    run = calling(client.create_run, experiment, run_name=f"report of {results.name}", tags=tags).info.run_id
    for name, value in headline_numbers(report).items():
        calling(client.log_metric, run, name, value)
    for path in report.files:
        place = path.parent.relative_to(report.folder)
        calling(client.log_artifact, run, str(path), None if place == Path() else str(place))
    calling(client.set_terminated, run)


def headline_numbers(report: Report) -> dict[str, float]:
    """Runs, verdicts and the correlations of the main grid, as MLflow metrics."""
    evidence = report.evidence
    numbers = {"runs": float(len(evidence.results.runs))}
    for settings in (PAPER, CORRECTED):
        for name in verdicts.VERDICTS:
            count = sum(claim.verdict(settings) == name for claim in report.claims)
            numbers[f"claims {settings}/{name}"] = float(count)
    for mode in evidence.modes if len(evidence.main) else ():
        for test in GIVEN:
            found = evidence.association(mode, "gap", test)
            if np.isfinite(found.estimate):
                numbers |= {f"{mode}/{test}/pearson": found.estimate, f"{mode}/{test}/pearson_p": found.p}
    return numbers
