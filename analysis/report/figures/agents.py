"""The figures about information and learning: 4b, 5a, 5b, SAC, mass and frame stack."""

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.transforms import ScaledTranslation

from analysis.plotting import style
from analysis.plotting.figures import DOT, draw_line, new_figure
from analysis.plotting.names import panel_name, word_for
from analysis.report.captions import FIGURES
from analysis.report.claims.claim import METRIC_2022, METRIC_OURS
from analysis.report.claims.evidence import Evidence
from analysis.report.claims.rows import ACCURACIES, GAPS, PROBES, accuracies, auxiliary
from analysis.report.claims.scores import COMPARED, LEAST_SEEDS, profiles
from analysis.report.figures.drawing import (
    CELL,
    SHORT_GAP,
    Drawn,
    dots,
    draw_curves,
    figure_of_panels,
    legend_below,
)
from analysis.report.number_format import estimate_text
from analysis.report.results import FRAME, MEMORY, STACK, panels_of, with_panel
from analysis.tables import binned, column, count_of, mean_by, pick, select

THRESHOLDS = np.linspace(-0.5, 1.0, 61)  # of scores, in performance profiles
CHANCE_SEEN = 0.65  # accuracies: where all are above it, the axis does not go down to chance
NO_PROBES = "the agents were not probed (`probes.parquet`)"


def figure_4b(evidence: Evidence) -> Drawn | str:
    """Gap against the accuracy of the critic, as in the paper and corrected."""
    probed = accuracies(evidence.results, evidence.main)
    if probed.empty:
        return NO_PROBES
    table = pick(probed, [*CELL, "probe", *ACCURACIES, "gap", "gap_2022"])
    figure = new_figure(9, 4.2)
    for axes, settings in zip(figure.subplots(1, 2), (METRIC_2022, METRIC_OURS), strict=True):
        draw_accuracy(evidence, axes, select(table, probe=PROBES[settings]), GAPS[settings], settings)
    return Drawn(figure, table)


def draw_accuracy(evidence: Evidence, axes: Axes, table: pd.DataFrame, gap: str, title: str) -> None:
    """Two point sets, training and test levels, a line each where there are blocks enough."""
    found = {levels: evidence.correlation(table, f"accuracy_{levels}", gap) for levels in ("train", "test")}
    for levels, colour, marker in zip(found, style.PALETTE, style.MARKERS, strict=False):
        x, y = column(table, f"accuracy_{levels}"), column(table, gap)
        label = f"{levels}: {estimate_text(found[levels])}"
        axes.scatter(x, y, s=32, color=colour, marker=marker, label=label, **DOT)
    if len(table) and min(column(table, name).min() for name in ACCURACIES) < CHANCE_SEEN:
        axes.axvline(0.5, color="#999999", linewidth=0.9, linestyle="--")
    # After all points, because lines keep to the limits that the points made.
    for levels, colour in zip(found, style.PALETTE, strict=False):
        if np.isfinite(found[levels].low):
            draw_line(axes, column(table, f"accuracy_{levels}"), column(table, gap), colour)
    axes.set_title(title)
    axes.set_xlabel("accuracy of the critic")
    axes.set_ylabel(SHORT_GAP)
    below = axes.transAxes + ScaledTranslation(0, -0.4, axes.figure.dpi_scale_trans)  # ticks and label [in]
    axes.legend(loc="upper center", bbox_to_anchor=(0.5, 0), bbox_transform=below, fontsize=8.5)


def accuracy_grid(evidence: Evidence, parts: list[list[tuple[str, pd.DataFrame, str]]], width: float) -> Figure:
    """Rows of axes, each of a title, its runs and the column of the gap; ``width`` in inches is that of one axes."""
    figure = new_figure(width * len(parts[0]), 2.7 * len(parts))
    for row, drawn in zip(figure.subplots(len(parts), len(parts[0]), squeeze=False), parts, strict=True):
        for axes, (title, table, gap) in zip(row, drawn, strict=True):
            draw_accuracy(evidence, axes, table, gap, title)
    return figure


def figure_5a(evidence: Evidence) -> Drawn | str:
    """Gap against accuracy per self-supervised algorithm; without probes, the gaps alone."""
    runs = evidence.results.of("figure_5a")
    if not auxiliary(runs):
        return "no agents with self-supervised losses were trained (`experiments=[figure_5a]`)"
    probed = accuracies(evidence.results, runs)
    algorithms = sorted(set(runs["algorithm"]))
    if probed.empty:
        table = pick(runs, [*CELL, "algorithm", "gap"])
        named = table.assign(algorithm=[word_for(name) for name in table["algorithm"]])
        return Drawn(dots(named, "algorithm", "gap", SHORT_GAP), table, FIGURES["figure_5a_without_probes"])
    table = pick(probed, [*CELL, "algorithm", "probe", *ACCURACIES, "gap", "gap_2022"])
    parts = [
        [
            (f"{word_for(name)}, {key}", select(table, probe=PROBES[key], algorithm=name), GAPS[key])
            for key in (METRIC_2022, METRIC_OURS)
        ]
        for name in algorithms
    ]
    return Drawn(accuracy_grid(evidence, parts, 4.3), table)


def figure_5b(evidence: Evidence) -> Drawn | str:
    """Training curves of the main grid."""
    if evidence.results.curves.empty or evidence.ungated.main.empty:
        return "the curves are not among the tables (`curves.parquet`)"
    curves = evidence.all_results.curves
    chosen = select(curves, name="episode/return").merge(pick(evidence.ungated.main, ["run", *CELL]), on="run")
    if chosen.empty:
        return "the curves have no returns of training episodes"
    chosen = chosen.assign(frames=binned(column(chosen, "frames")))
    table = mean_by(chosen, ["family", "difficulty", "n", "frames"], ["value"])
    families, difficulties = style.ordered(table["family"]), style.ordered(table["difficulty"])
    colours = dict(zip(sorted(set(table["n"])), style.SEQUENCE, strict=False))
    figure = new_figure(2.35 * len(families), 2.0 * len(difficulties) + 0.4)
    grid = figure.subplots(len(difficulties), len(families), squeeze=False, sharex=True)
    for row, difficulty in zip(grid, difficulties, strict=True):
        for axes, family in zip(row, families, strict=True):
            draw_curves(axes, select(table, family=family, difficulty=difficulty), colours, 1.3)
            axes.set_title(panel_name(f"{family}-{difficulty}"))
        row[0].set_ylabel("training return")
    for axes in grid[-1]:
        axes.set_xlabel("thousand frames")
    legend_below(figure, grid[0][0], 8, "training levels")
    return Drawn(figure, table)


def appendix_sac(evidence: Evidence) -> Drawn | str:
    """Test return of SAC against frames."""
    runs, curves = evidence.all_results.of("appendix_sac"), evidence.all_results.curves
    if runs.empty or curves.empty:
        return "SAC was not run, or its curves are not among the tables (`experiments=[appendix_sac]`)"
    chosen = select(curves, name="evaluation/test/return/deterministic").merge(
        pick(runs, ["run", "algorithm", *CELL]), on="run"
    )
    if chosen.empty:
        return "the curves have no returns of SAC on test levels"
    table = mean_by(chosen, ["algorithm", "family", "difficulty", "n", "frames"], ["value"])
    named = with_panel(table)
    panels = panels_of(named)
    colours = dict(zip(sorted(set(table["n"])), style.SEQUENCE, strict=False))
    figure, grid = figure_of_panels(len(panels), 3.1, 2.6, 0.4)
    for axes, panel in zip(grid, panels, strict=False):
        for algorithm, line in zip(sorted(set(named["algorithm"])), ("-", ":"), strict=False):
            part = select(named, panel=panel, algorithm=algorithm)
            draw_curves(axes, part, colours, style.LINE_WIDTH, line, word_for(algorithm))
        axes.set_title(panel_name(panel))
        axes.set_xlabel("thousand frames")
        axes.set_ylabel("return on test levels")
    legend_below(figure, grid[0], 2, "algorithm, training levels")
    return Drawn(figure, table)


def performance_profiles(evidence: Evidence) -> Drawn | str:
    """The share of runs that score above each threshold, per algorithm."""
    table = profiles(evidence.all_results, THRESHOLDS)
    if table.empty:
        return f"no experiment has scores of several algorithms with {LEAST_SEEDS} seeds or more"
    experiments = list(dict.fromkeys(table["experiment"]))
    colours = style.colours(table["algorithm"])
    figure = new_figure(4.6 * len(experiments), 3.6)
    grid = figure.subplots(1, len(experiments), sharey=True, squeeze=False)[0]
    for axes, experiment in zip(grid, experiments, strict=True):
        part = select(table, experiment=experiment)
        for algorithm in sorted(set(part["algorithm"])):
            one, colour = select(part, algorithm=algorithm), colours[algorithm]
            x = column(one, "threshold")
            axes.plot(x, column(one, "estimate"), color=colour, label=word_for(algorithm))
            axes.fill_between(x, column(one, "low"), column(one, "high"), color=colour, alpha=0.15, linewidth=0)
        axes.set_title(COMPARED[experiment])
        axes.set_xlabel("score on test levels")
        axes.legend(loc="lower left", fontsize=8.5)
    grid[0].set_ylabel("share of runs above it")
    return Drawn(figure, table)


def appendix_mass(evidence: Evidence) -> Drawn | str:
    """Gap against accuracy with the mass shown and hidden, by what the agent has of the past; without probes, gaps alone."""
    runs = evidence.results.masses
    if count_of(runs, "observation") < 2:
        return "it was not run (`experiments=[appendix_mass]`)"
    probed = accuracies(evidence.results, runs)
    if probed.empty:
        named = runs.assign(sees=runs["past"] + ", " + runs["mass"])
        table = pick(named, [*CELL, "sees", "w2_exact", "gap", "success_test_deterministic"])
        return Drawn(dots(table, "sees", "gap", SHORT_GAP), table, FIGURES["appendix_mass_without_probes"])
    columns = [*CELL, "past", "mass", "w2_exact", *ACCURACIES, "gap", "success_test_deterministic"]
    table = pick(select(probed, probe=PROBES[METRIC_OURS]), columns)
    pasts = [past for past in (FRAME, STACK, MEMORY) if past in set(table["past"])]
    parts = [
        [
            (f"{past}, mass {mass}", select(table, past=past, mass=mass), GAPS[METRIC_OURS])
            for mass in ("shown", "hidden")
        ]
        for past in pasts
    ]
    return Drawn(accuracy_grid(evidence, parts, 4.3), table)
