"""The report of a study of one's own: what was run, its claims, the gap against the distance, success, and other levels.

It reads the tables of a results folder and ``study.yaml``, in which ``experiments.study`` writes what the study asks. The
statistics, and the rules by which claims are decided, are those of the paper's report. All runs on one level set stay
together: where agents share level sets, a level set and not an agent is the unit.
"""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import yaml
from matplotlib.axes import Axes

from analysis.gap_plot import gap_plot
from analysis.plotting import style
from analysis.plotting.figures import DOT, save_figure, zero_line
from analysis.report.claims import verdicts
from analysis.report.claims.claim import Claim, Finding, claims_table, small_difference
from analysis.report.claims.evidence import Evidence
from analysis.report.document.blocks import Block, Bullets, Document, Heading, Paragraph, Picture, Table, Verdict
from analysis.report.document.html import page
from analysis.report.document.pdf import sheets
from analysis.report.document.sections import how_verdicts_are_decided, what_was_run
from analysis.report.document.tables import means
from analysis.report.figures.drawing import (
    GAP,
    Drawn,
    draw_curves,
    error_bars,
    figure_of_panels,
    legend_below,
    log_axis,
)
from analysis.report.number_format import estimate_text, interval, plain, signed
from analysis.report.results import PANEL, measured, paired, read_results
from analysis.runs import column_name
from analysis.stats.association import labels
from analysis.stats.estimate import Estimate
from analysis.tables import binned, column, count_of, keep, mean_by, pick, select, write_csv
from experiments.reproduction.experiment_file import SIGNS, ClaimConfig
from experiments.runs.files import write_bytes, write_text
from experiments.runs.trust import require_trust
from experiments.settings import ConfigError, RunFolderError, add_module_path, construct, import_object
from segar.errors import SegarError, did_you_mean

STUDY, PAGE, SHEETS, VERDICTS = "study.yaml", "report.html", "report.pdf", "claims.csv"
SUFFIXES = (".svg", ".png")
TESTED = "tested"  # how these claims are read: in one way
WORDS = {verdicts.REPRODUCED: "holds", verdicts.NOT_REPRODUCED: "does not hold"}  # for claims that nobody made before
AGENT_SEED = "seed of the agent"
KINDS = ("algorithm", "observation", "task", "variation", "design")  # columns that may tell agents apart
NEEDED = ("family", "difficulty", "seed", "n", "run", "w2_exact", "gap_deterministic", "gap_ref_deterministic")
ALL = "all agents"
ETA, SUCCESS = "eta_test_deterministic", ("success_train_deterministic", "success_test_deterministic")


@dataclass(frozen=True)
class Study:
    """What a study asks, and what its tables say.

    ``runs`` has the columns of :func:`analysis.report.results.measured`; ``agent``, the settings that tell agents apart, in
    words; and ``levels``, which is ``n``. ``seed`` is that of the level set.
    """

    asked: Mapping[str, Any]
    evidence: Evidence
    runs: pd.DataFrame
    told_apart: Sequence[str]  # columns that vary beside panels, numbers of levels and seeds

    @property
    def panels(self) -> list[str]:
        """The panels, in their order of first appearance."""
        return list(dict.fromkeys(self.runs["panel"]))

    def tested_on(self, label: str) -> pd.DataFrame:
        """The columns of ``runs`` for the agents on the levels of a transfer; raises :class:`ConfigError`."""
        moved = self.evidence.results.moved
        there = select(moved, test=label) if len(moved) else moved
        if there.empty:
            raise ConfigError(
                f"on: no agent was tested on '{label}'.{did_you_mean(label, set(map(str, moved['test'])))}"
            )
        own = ["run", *(name for name in self.runs if name not in there), "seed"]
        return there.drop(columns=["seed"]).merge(pick(self.runs, own), on="run")

    @property
    def agents(self) -> list[str]:
        """The kinds of agents."""
        return sorted(set(self.runs["agent"]))


def is_study(folder: Path) -> bool:
    """Whether a results folder is that of a study."""
    return (folder / STUDY).exists()


def make_study_report(folder: Path, out: Path) -> tuple[Study, list[Claim], list[Path]]:
    """Reads the tables in ``folder``, and writes claims, figures and report into ``out``; returns the study, claims and files.

    Raises:
        RunFolderError: a table is not there, or somebody else's study names code of its own.
        ConfigError: a claim names a column that does not exist.
    """
    study = read_study(folder)
    claims = [claim_or_reason(study, name, one) for name, one in study.asked.get("claims", {}).items()]
    pictures = {name: picture(study, out, name, draw) for name, draw in FIGURES.items()}
    text = document(study, claims, pictures)
    files = [out / VERDICTS, out / PAGE, out / SHEETS]
    table = claims_table(claims).drop(columns=["settings", "of_claim", "of_claim_corrected", "where", "follows"])
    write_csv(files[0], table.replace({"verdict": WORDS}), 4)
    write_text(files[1], page(text))
    write_bytes(files[2], sheets(text))
    drawn = [name for name, one in pictures.items() if isinstance(one, Picture)]
    return (
        study,
        claims,
        [*files, *(out / "figures" / f"{name}{suffix}" for name in drawn for suffix in (*SUFFIXES, ".csv"))],
    )


def read_study(folder: Path) -> Study:
    """The study in a results folder; raises :class:`RunFolderError`."""
    path = folder / STUDY
    try:
        text = path.read_text()
        asked = yaml.safe_load(text)
    except (OSError, ValueError, yaml.YAMLError) as error:
        raise RunFolderError(f"cannot read {path}: {error}") from error
    claims = asked.get("claims") or {}
    require_trust(path, text, {"claims": [one.get("test", "") for one in claims.values()]})
    add_module_path(asked.get("module_path", ()))
    results = read_results(folder, NEEDED)
    table, vary = results.runs, [str(name) for name in (asked.get("grid") or {}).get("vary", ())]
    shared = table["levels.seed"].fillna(table["seed"]) if "levels.seed" in table else table["seed"]
    table = table.assign(**{AGENT_SEED: table["seed"], "seed": shared.astype(int)})
    told_apart = [name for name in (*KINDS, *vary) if name in table and count_of(table, name) > 1]
    table = measured(table)
    agent = [agent_name(row, told_apart) for row in table.to_dict("records")]
    return Study(asked, Evidence(results), table.assign(agent=agent, levels=table["n"]), told_apart)


def agent_name(row: Mapping[Any, Any], told_apart: Sequence[str]) -> str:
    """What tells a kind of agents apart, such as ``curl, gamma=0.9``."""
    words = (str(row[name]) if name in KINDS else f"{name.rpartition('.')[2]}={row[name]}" for name in told_apart)
    return ", ".join(filter(None, words)) or ("default" if told_apart else ALL)


def claim_or_reason(study: Study, name: str, asked: Mapping[str, Any]) -> Claim:
    """The claim with its finding, or why it cannot be tested."""
    try:
        return claim_of(study, name, construct(ClaimConfig, asked, name))
    except ConfigError as error:
        return Claim(name, str(asked["says"]), "", needs=f"another claim or other runs ({error})")


def claim_of(study: Study, name: str, claim: ClaimConfig) -> Claim:
    """The claim with its finding; raises :class:`ConfigError` for a column that does not exist or a test that goes wrong."""
    try:
        words, measure, found, margin = tested(study, name, claim)
    except SegarError as error:
        raise ConfigError(f"claims.{name}: {error}") from error
    sign = SIGNS[claim.expected]
    verdict = verdicts.of_effect(found, sign, margin) if sign else verdicts.of_absence(found, margin)
    expected = f"Expected: {claim.expected}; effects below {plain(margin, 3)} do not matter. {found.note}".strip()
    if not np.isfinite(found.estimate):
        return Claim(
            name, claim.says, words, needs=f"other runs ({found.note or 'nothing can be computed from these'})"
        )
    return Claim(name, claim.says, words, (Finding(TESTED, words, measure, found, verdict),), note=expected)


def tested(study: Study, name: str, claim: ClaimConfig) -> tuple[str, str, Estimate, float]:
    """What is tested in words, what the estimate is, the estimate, and the margin below which it does not matter."""
    rows = chosen(study.tested_on(claim.on) if claim.on else study.runs, claim.where)
    if ":" in claim.test:
        found = import_object(claim.test, "test")(rows)
        if not isinstance(found, Estimate):
            raise ConfigError(
                f"test: {claim.test} returns {type(found).__name__}, not an analysis.stats.estimate.Estimate"
            )
        return claim.test, "estimate", found, claim.margin or 0.0
    of = named(rows, "of", claim.of)
    if claim.test == "correlation":
        against, given = named(rows, "against", claim.against), [named(rows, "given", one) for one in claim.given]
        rows = keep(rows, np.isfinite(column(rows, of)) & np.isfinite(column(rows, against)))
        words = f"{of} against {against}" + (f", given {', '.join(given)}" if given else "")
        found = study.evidence.correlation(name, rows, against, of, given)
        return words, "partial Pearson r" if given else "Pearson r", found, claim.margin or verdicts.SMALL_R
    words, rows = f"mean of {of}", keep(rows, np.isfinite(column(rows, of))).assign(difference=rows[of])
    if claim.test == "difference":
        words, rows = differences(study, rows, of, claim.between)
    margin = claim.margin or small_difference(rows)
    return words, "mean difference" if claim.between else "mean", study.evidence.mean(name, rows), margin


def chosen(runs: pd.DataFrame, where: Mapping[str, Any]) -> pd.DataFrame:
    """The runs with the given values, or one of a list of values, in some columns."""
    for name, value in where.items():
        values = {str(one) for one in (value if isinstance(value, list) else [value])}
        known = named(runs, "where", name)
        runs = keep(runs, [str(one) in values for one in runs[known]])
    if runs.empty:
        raise ConfigError(f"where: no run has {dict(where)}")
    return runs


def differences(
    study: Study, rows: pd.DataFrame, of: str, between: Mapping[str, Sequence[Any]]
) -> tuple[str, pd.DataFrame]:
    """Pairs of runs that differ in one column, as the rows of the first with ``difference``, and what they are in words."""
    (name, (first, second)), *_ = between.items()
    by = named(rows, "between", name)
    parts = [keep(rows, [str(one) == str(value) for one in rows[by]]) for value in (first, second)]
    shared = [
        name for name in PANEL if set(parts[0][name]) & set(parts[1][name])
    ]  # none where whole panels are compared
    at = [one for one in (*shared, "n", "seed", AGENT_SEED, *study.told_apart) if one != by]
    for value, part in zip((first, second), parts, strict=True):
        if part.empty:
            raise ConfigError(
                f"between: no run has {by}={value}; there are {', '.join(sorted(set(map(str, rows[by]))))}"
            )
    found = paired(parts[0], parts[1], of, at)
    if found.empty:
        raise ConfigError(f"between: no two runs are equal but for {by}={first} and {second}")
    return f"{of}: {first} less {second}, same {', '.join(at)}", found


def named(runs: pd.DataFrame, setting: str, name: str) -> str:
    """The column that a claim names; raises :class:`ConfigError`."""
    try:
        return column_name(runs, name)
    except SegarError as error:
        raise ConfigError(f"{setting}: {error}") from error


def gap_against_distance(study: Study) -> Drawn | str:
    """The gap of each run against exact W2."""
    runs = study.runs
    if not np.isfinite(column(runs, "w2_exact")).any():
        return "no run has its exact W2"
    group = "agent" if len(study.panels) == 1 else "panel"
    group = group if 1 < count_of(runs, group) <= len(style.PALETTE) else None
    figure = gap_plot(pick(runs, [one for one in runs if one != "levels.seed"]), "w2_exact", "gap_deterministic", group)
    table = pick(runs, ["panel", "agent", "n", "seed", "w2_exact", "gap", "gap_se"])
    return Drawn(figure, table, "The gap of each run against the exact W2 between its training and test levels.")


def by_number(
    study: Study, values: Sequence[str], label: str, caption: str, limits: tuple[float, float] | None
) -> Drawn:
    """An axes per panel: means against the number of training levels, a line for each kind of agent."""
    table = pd.concat(
        [means(study.evidence, study.runs, ["panel", "agent", "levels"], one, one).assign(figure=one) for one in values]
    )
    colours = dict(zip(study.agents, style.PALETTE * len(study.agents), strict=False))
    figure, grid = figure_of_panels(len(study.panels), 3.7, 3.2, 0.5)
    for axes, panel in zip(grid, study.panels, strict=False):
        for agent in study.agents:
            for k, one in enumerate(values):
                part = select(table, panel=panel, agent=agent, figure=one)
                draw_means(
                    axes,
                    part,
                    colours[agent],
                    ":" if len(values) > 1 and k == 0 else "-",
                    agent if one == values[-1] else "",
                )
        zero_line(axes)
        log_axis(axes, sorted(set(study.runs["n"])))
        axes.set_title(panel)
        axes.set_xlabel("training levels")
        if limits:
            axes.set_ylim(*limits)
    grid[0].set_ylabel(label)
    if len(study.agents) > 1:
        legend_below(figure, grid[0], 2)
    return Drawn(figure, pick(table, ["figure", "panel", "agent", "levels", "estimate", "low", "high"]), caption)


def draw_means(axes: Axes, part: pd.DataFrame, colour: str, line: str, label: str) -> None:
    """Means with their intervals, and a line through them."""
    n = column(part, "levels")
    axes.errorbar(
        n, column(part, "estimate"), yerr=error_bars(part, "estimate"), color=colour, linestyle=line, capsize=2.5
    )
    axes.scatter(n, column(part, "estimate"), color=colour, s=26, zorder=3, label=label or None, **DOT)


def success(study: Study) -> Drawn | str:
    """Success on training and test levels."""
    caption = "Success: test levels (solid) and training levels (dotted), with 95 % intervals over level sets."
    return by_number(study, SUCCESS, "success", caption, (-0.03, 1.03))


def gap(study: Study) -> Drawn | str:
    """The gap by number of training levels."""
    return by_number(study, ["gap"], GAP, "The gap, with 95 % intervals over level sets.", None)


def curves(study: Study) -> Drawn | str:
    """Training returns against frames, by number of training levels."""
    table = study.evidence.results.curves
    rows = select(table, name="episode/return") if len(table) else table
    if rows.empty:
        return "there are no returns of training episodes"
    rows = rows.merge(pick(study.runs, ["run", "panel", "n"]), on="run")
    rows = rows.assign(frames=binned(column(rows, "frames")))
    found = mean_by(rows, ["panel", "n", "frames"], ["value"])
    colours = dict(zip(sorted(set(found["n"])), style.SEQUENCE * 3, strict=False))
    figure, grid = figure_of_panels(len(study.panels), 3.7, 2.9, 0.5)
    for axes, panel in zip(grid, study.panels, strict=False):
        draw_curves(axes, select(found, panel=panel), colours, 1.3)
        axes.set_title(panel)
        axes.set_xlabel("thousand frames")
    grid[0].set_ylabel("training return")
    legend_below(figure, grid[0], 8, "training levels")
    return Drawn(figure, found, "Returns of training episodes, means over agents and seeds.")


FIGURES: Mapping[str, Callable[[Study], Drawn | str]] = {
    "gap_against_distance": gap_against_distance, "success": success, "gap": gap, "curves": curves,
}  # fmt: skip


def picture(study: Study, out: Path, name: str, draw: Callable[[Study], Drawn | str]) -> Picture | str:
    """Draws a figure and writes its files; returns the picture, or why it cannot be drawn."""
    with style.applied():
        found = draw(study)
    if isinstance(found, str):
        return found
    svg, png = save_figure(found.figure, out / "figures" / name, SUFFIXES)
    write_csv(svg.with_suffix(".csv"), found.table, 6)
    command = "python -m analysis.report results=."  # in the folder of the report
    return Picture(name, found.caption, svg.read_bytes(), png, command)


def document(study: Study, claims: Sequence[Claim], pictures: Mapping[str, Picture | str]) -> Document:
    """The whole report."""

    def drawn(name: str) -> Block:
        one = pictures[name]
        return Paragraph(f"No figure: {one}.") if isinstance(one, str) else one

    blocks: list[Block] = [*opening(study, claims), *map(Verdict, claims)]
    blocks += [Heading("Gap against distance"), drawn("gap_against_distance"), drawn("gap")]
    blocks += [Heading("Success"), drawn("success"), cells(study), *other_levels(study)]
    blocks += [Heading("Learning"), drawn("curves"), *what_was_run(study.evidence)]
    if claims:
        head, *rules = how_verdicts_are_decided()
        blocks += [head, Paragraph("A claim **holds** where these rules say reproduced."), *rules]
    return Document(str(study.asked["title"]), f"The study `{study.asked['name']}`", blocks, (TESTED,), WORDS)


def opening(study: Study, claims: Sequence[Claim]) -> Iterator[Block]:
    """What there is, what is missing, and the claims in sentences."""
    runs, results = study.runs, study.evidence.results
    sets, kinds = len(set(labels(runs, ["panel", "seed"]))), "one kind"
    if len(study.agents) > 1:
        kinds = f"{len(study.agents)} kinds"
    yield Paragraph(
        f"{len(runs)} runs in {len(study.panels)} panels, on {sets} level sets, with {kinds} of agents. The"
        " gap is the mean return on test levels less that on training levels; negative means worse on test levels.",
        "lead",
    )
    missing = results.missing_runs() if results.missing is not None else []
    if missing:
        shown = ", ".join(missing[:8]) + (" and others" if len(missing) > 8 else "")
        yield Paragraph(f"**Of what was planned, {len(missing)} runs or tests are missing**: {shown}.", "warning")
    yield from repeated(runs, sets)
    yield Heading("Claims")
    if not claims:
        yield Paragraph("The study's file has no claims.")
        return
    sentences = []
    for claim in claims:
        verdict = claim.verdict(TESTED)
        numbers = [estimate_text(one.found, one.measure) for one in claim.findings]
        sentences.append(
            f"**{claim.name}** {claim.statement} {WORDS.get(verdict, verdict).capitalize()}. {' '.join(numbers)}"
        )
    yield Bullets(sentences)


def repeated(runs: pd.DataFrame, sets: int) -> Iterator[Block]:
    """A warning where several agents of a kind share each level set, or where there are few level sets."""
    most = max(len(part) for _, part in runs.groupby(["panel", "agent", "n", "seed"]))
    if most > 1:
        yield Paragraph(
            f"Up to {most} agents of a kind share a level set. Intervals are over level sets: more agents on one set do not "
            "make them shorter.",
            "warning",
        )
    fewest = min(count_of(part, "seed") for _, part in runs.groupby("panel"))
    if fewest < 3:
        yield Paragraph(
            f"Some panels have {fewest} level set{'s' * (fewest != 1)} of a size: intervals are wide, or there are none. More "
            "`grid.seeds` mend that.",
            "warning",
        )


def cells(study: Study) -> Table:
    """A row for each panel, kind of agent and number of levels."""
    by = ["panel", "agent", "levels"]
    found = {name: means(study.evidence, study.runs, by, name, name) for name in ("w2_exact", "gap", *SUCCESS)}
    rows = []
    for at, row in enumerate(found["gap"].to_dict("records")):
        part = select(study.runs, **{name: row[name] for name in by})
        numbers = (float(column(found[name], "estimate")[at]) for name in ("w2_exact", *SUCCESS))
        rows.append([str(row["panel"]), str(row["agent"]), str(row["levels"]), str(len(part)), str(count_of(part, "seed")),
                     *map(plain, numbers), signed(row["estimate"]), interval(Estimate.of_row(row))])  # fmt: skip
    head = (
        "panel",
        "agent",
        "training levels",
        "runs",
        "level sets",
        "exact W2",
        "success, training",
        "success, test",
        "gap",
        "95 %",
    )
    return Table(head, rows, 2, "Means over runs; the gap with its interval over level sets.", folded=len(rows) > 30)


def other_levels(study: Study) -> list[Block]:
    """What the agents achieve on other levels, beside their own test levels."""
    moved = study.evidence.results.moved
    if moved.empty:
        return []
    known = pick(study.runs, ["run", "agent", "seed"])
    there = paired(moved, study.runs, ETA, ["run"]).drop(columns=["seed"]).merge(known, on="run")
    there = there.assign(levels=there["n"])
    by = ["panel", "agent", "test", "levels"]
    found = means(study.evidence, there, by, "difference", "transfer")
    shares = means(study.evidence, there, by, SUCCESS[1], "transfer success")
    rows = [
        [*(str(row[name]) for name in by), plain(float(share)), signed(row["estimate"]), interval(Estimate.of_row(row))]
        for row, share in zip(found.to_dict("records"), column(shares, "estimate"), strict=True)
    ]
    head = (*by[:3], "training levels", "success there", "return there less own test levels", "95 %")
    return [Heading("On other levels"), Table(head, rows, 3, "The same agents on levels of other distributions.")]
