"""``segar report results=FOLDER``: claims, statistics, figures and a page from the tables of a folder.

``FOLDER`` is one that segar.experiments.reproduce made, or one of docs/results; only its tables are read. Written there:
``report.html``, ``claims.csv``, ``figures/<name>.{svg,png,csv}`` and ``statistics/<name>.csv``. ``pdf=true`` prints the page
into ``report.pdf``, too, where Chromium is installed. ``only=[figure_3a]`` draws figures and makes nothing else.
``serve=true`` shows the report that is there in a browser, where a dot of figure 3a opens its agent on its worst test level.
"""

import shlex
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from threadpoolctl import threadpool_limits

from segar.analysis.report.claims import verdicts
from segar.analysis.report.claims.claim import CLAIMS, METRIC_2022, METRIC_OURS, Claim, claims_table
from segar.analysis.report.claims.evidence import GIVEN, Evidence
from segar.analysis.report.claims.reading import read_claims
from segar.analysis.report.document import sections
from segar.analysis.report.document.blocks import Document, Picture
from segar.analysis.report.document.files import PAGE, SUFFIXES, write_document, write_picture
from segar.analysis.report.document.tables import STATISTICS, statistics
from segar.analysis.report.figures import FIGURES
from segar.analysis.report.figures.drawing import Drawn
from segar.analysis.report.results import read_results
from segar.analysis.report.serve import serve_report
from segar.analysis.report.study import document, figures
from segar.analysis.report.study.claims import TESTED, WORDS, claim_or_reason
from segar.analysis.report.study.reading import is_study, read_study
from segar.analysis.tables import write_csv
from segar.experiments.commands.command_line import run_from_command_line
from segar.experiments.reproduction.experiment_file import PLAN, SCALES
from segar.experiments.reproduction.imported_results import RUNS
from segar.experiments.runs.files import absolute_path, read_json
from segar.experiments.settings import RunFolderError, TrackingConfig, construct, require_known
from segar.experiments.tracking.mlflow_store import replace_run
from segar.support import RESULTS, WORKSPACE, counted

SHIPPED = RESULTS
PAPERS = ("of", "settings", "runs", "where", "follows")  # columns of claims that only the paper's report fills


@dataclass(frozen=True)
class ReportConfig:
    """The settings of a report: the results, the folder that it is written to, and which figures."""

    results: str | None = None  # a folder of tables; None: the largest scale in docs/results
    out: str | None = None  # None: into that folder
    pdf: bool = False  # print the page into report.pdf, too, which takes Chromium
    only: tuple[str, ...] = ()  # names of figures: these alone are drawn, nothing else is made
    serve: bool = False  # make nothing; show the page on the loopback address, where dots of runs open their agents
    port: int = 0  # of that; 0: a free one
    tracking: bool = False  # show the report in the store of MLflow that the plan in the folder names

    @property
    def folder(self) -> Path:
        """Absolute path of the tables; raises :class:`RunFolderError` if none is named and none is shipped."""
        if self.results is not None:
            return absolute_path(self.results)
        for scale in reversed(SCALES):
            if (SHIPPED / scale / RUNS).exists():
                return SHIPPED / scale
        raise RunFolderError(f"there are no results in {SHIPPED}; name a folder of tables: results=FOLDER")

    @property
    def name(self) -> str:
        """The folder as commands in the report name it: from the checkout if it is there."""
        folder = self.folder
        return str(folder.relative_to(WORKSPACE) if folder.is_relative_to(WORKSPACE) else folder)


@dataclass(frozen=True)
class Subject:
    """The parts of a report, each of which is made when it is asked for."""

    evidence: Evidence
    figures: Mapping[str, Callable[[], Drawn]]  # by name; each may raise NoFigure
    claims: Callable[[], list[Claim]]
    document: Callable[[list[Claim], Mapping[str, Picture | str]], Document]
    statistics: Callable[[], Mapping[str, pd.DataFrame]] = dict  # by the names of their CSV files
    claims_table: Callable[[list[Claim]], pd.DataFrame] = claims_table
    readings: Sequence[str] = (METRIC_2022, METRIC_OURS)  # in which claims are tested, as findings name them
    words: Mapping[str, str] = field(default_factory=dict)  # for verdicts, where others are better

    def sentence(self, claim: Claim) -> str:
        """What became of a claim, or what it takes to test it."""
        read = filter(None, (claim.verdict(reading) for reading in self.readings))
        said = f"{claim.name}: {', '.join(self.words.get(one, one) for one in read)}: {claim.statement}"
        return f"{said} It needs {claim.needs}." if claim.needs else said


@dataclass(frozen=True)
class Report:
    """A report: its folder and files, its claims, and what it is about."""

    folder: Path
    files: list[Path]
    claims: list[Claim]
    subject: Subject


def report_results(results: Path) -> None:
    """Makes the report of a results folder: what ``segar reproduce`` calls, as the plug-in ``report``."""
    report(ReportConfig(str(results), tracking=True))


def report(config: ReportConfig) -> None:
    """Makes the report and prints what came of it; or serves the one that is there."""
    if config.serve:
        return serve_report(config.folder, absolute_path(config.out or config.folder), config.port)
    made = make_report(config)
    results = made.subject.evidence.results
    print(f"In the report: {counted(len(results.runs), 'run')}. Missing, runs or tests: {len(results.missing)}.")
    for line in map(str, made.files) if config.only else map(made.subject.sentence, made.claims):
        print(line)
    if not config.only:
        print(f"report: {made.folder / PAGE}")


@threadpool_limits.wrap(limits=1)  # in least squares of small tables, threads would wait for each other
def make_report(config: ReportConfig) -> Report:
    """Reads the tables and writes the report; the same tables give the same bytes.

    Raises:
        RunFolderError: a table is missing, somebody else's study names code of its own, or nothing here prints a PDF.
        ConfigError: there is no such figure.
    """
    subject = study(config.folder) if is_study(config.folder) else paper(config.folder)
    for name in config.only:
        require_known("only", name, list(subject.figures))
    folder = absolute_path(config.out) if config.out else config.folder
    command = f"segar report results={shlex.quote(config.name)} only=[{{}}]"
    asked = {name: draw for name, draw in subject.figures.items() if not config.only or name in config.only}
    drawn = {name: write_picture(draw, folder, name, command.format(name)) for name, draw in asked.items()}
    there = [name for name, one in drawn.items() if isinstance(one, Picture)]
    files = [folder / "figures" / f"{name}{suffix}" for name in there for suffix in (*SUFFIXES, ".csv")]
    if config.only:
        return Report(folder, files, [], subject)
    claims = subject.claims()
    written = {folder / "statistics" / f"{name}.csv": table for name, table in subject.statistics().items()}
    written[folder / CLAIMS] = subject.claims_table(claims)
    for path, table in written.items():
        write_csv(path, table, 4)
    files += [*written, *write_document(subject.document(claims, drawn), folder, config.pdf)]
    remove_others(folder, subject, files)
    report = Report(folder, files, claims, subject)
    if config.tracking:
        track(config.folder, report)
    return report


def remove_others(folder: Path, subject: Subject, files: list[Path]) -> None:
    """Removes figures and statistics that an earlier report left and this one does not have; files of other names stay."""
    known = [folder / "figures" / f"{name}{suffix}" for name in subject.figures for suffix in (*SUFFIXES, ".csv")]
    known += [folder / "statistics" / f"{name}.csv" for name in STATISTICS]
    for path in {*known} - {*files}:
        path.unlink(missing_ok=True)


def track(results: Path, report: Report) -> None:
    """Writes headline numbers and files to MLflow, as a run of its own; a repeated report replaces that run."""
    form = {"tracking": dict, "runs": str}
    plan: dict[str, Any] = read_json(results / PLAN, form) if (results / PLAN).exists() else {}
    if plan.get("tracking", {"name": "none"})["name"] == "none":
        return
    tracking = construct(TrackingConfig, plan["tracking"], "tracking")
    tags = {"kind": "report", "report_folder": str(report.folder), "scale": report.subject.evidence.results.scale}
    places = {path: path.parent.relative_to(report.folder) for path in report.files}
    replace_run(
        tracking, Path(plan["runs"]), f"report of {results.name}", tags, "report_folder",
        metrics=headline_numbers(report),
        files={path: None if place == Path() else str(place) for path, place in places.items()},
    )  # fmt: skip


def headline_numbers(report: Report) -> dict[str, float]:
    """Runs, verdicts and the correlations of the main grid, as MLflow metrics."""
    evidence = report.subject.evidence
    numbers = {"runs": float(len(evidence.results.runs))}
    for settings in report.subject.readings:
        read = Counter(claim.verdict(settings) for claim in report.claims)
        numbers |= {f"claims {settings}/{name}": float(read[name]) for name in verdicts.VERDICTS}
    for mode in evidence.modes if len(evidence.results.main) else ():
        for test in GIVEN:
            found = evidence.of_main(mode, "gap", test)
            if np.isfinite(found.estimate):
                numbers |= {f"{mode}/{test}/pearson": found.estimate, f"{mode}/{test}/pearson_p": found.p}
    return numbers


def paper(folder: Path) -> Subject:
    """The paper's experiments, whose tables are in a folder; raises :class:`RunFolderError`."""
    evidence = Evidence(read_results(folder))
    return Subject(
        evidence,
        {name: partial(draw, evidence) for name, draw in FIGURES.items()},
        claims=lambda: read_claims(evidence),
        statistics=lambda: statistics(evidence),
        document=lambda claims, drawn: sections.document(evidence, claims, drawn),
    )


def study(folder: Path) -> Subject:
    """The study whose tables are in a folder; raises :class:`RunFolderError`, also where somebody else's study names code of
    its own. A claim that cannot be tested is in the report with the reason."""
    asked = read_study(folder)
    return Subject(
        asked.evidence,
        {name: partial(draw, asked) for name, draw in figures.FIGURES.items()},
        claims=lambda: [claim_or_reason(asked, name, one) for name, one in asked.asked.get("claims", {}).items()],
        claims_table=tested_claims,
        document=lambda claims, drawn: document.document(asked, claims, drawn),
        readings=(TESTED,),
        words=WORDS,
    )


def tested_claims(claims: list[Claim]) -> pd.DataFrame:
    """``claims.csv`` of a study: one row per test."""
    table = claims_table(claims)
    table = table.drop(columns=[one for one in table if one.startswith("of_claim") or one in PAPERS])
    return table.replace({"verdict": WORDS})


def main() -> None:
    """The command, with what the command line states."""
    run_from_command_line(report, ReportConfig)
