"""The figures about information and learning: 4b, 5a, 5b, SAC, mass and frame stack."""

from itertools import chain

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.transforms import ScaledTranslation

from segar.analysis.plotting import style
from segar.analysis.plotting.figures import DOT, draw_line, entry, new_figure
from segar.analysis.plotting.names import panel_name, word_for
from segar.analysis.report.claims.claim import METRIC_OURS
from segar.analysis.report.claims.evidence import Evidence
from segar.analysis.report.claims.rows import ACCURACIES, GAPS, LEVELS, PROBES, accuracies, auxiliary, rows_of
from segar.analysis.report.claims.scores import COMPARED, profiles
from segar.analysis.report.claims.statements import METRICS
from segar.analysis.report.figures.drawing import CELL, SHORT_GAP, Drawn, NoFigure, drawable, figure_of_curves
from segar.analysis.report.number_format import estimate_text
from segar.analysis.report.results import FRAME, MEMORY, STACK, panels_of, with_panel
from segar.analysis.stats.resampling import FEWEST_UNITS
from segar.analysis.tables import binned, column, mean_by, pick, select

THRESHOLDS = np.linspace(-0.5, 1.0, 61)  # of scores, in performance profiles
CHANCE_SEEN = 0.65  # accuracies: where all are above it, the axis does not go down to chance
NO_PROBES = "the agents were not probed (`probes.parquet`)"


def figure_4b(evidence: Evidence) -> Drawn:
    """Gap against the accuracy of the critic, as in the paper and corrected."""
    probed = drawable(rows_of("probes", evidence), NO_PROBES)
    table = pick(probed, [*CELL, "probe", *ACCURACIES, "gap", "gap_2022"])
    parts = [(settings, select(table, probe=PROBES[settings]), GAPS[settings]) for settings in METRICS]
    return Drawn(accuracy_grid(evidence, [parts], 4.2), table)


def accuracy_grid(evidence: Evidence, parts: list[list[tuple[str, pd.DataFrame, str]]], height: float = 2.7) -> Figure:
    """Rows of axes of this height, each of a title, its runs and the column of the gap: two point sets, of training and of test
    levels. The axes below each other are the same."""
    figure = new_figure(4.5 * len(parts[0]), height * len(parts))
    grid = figure.subplots(len(parts), len(parts[0]), squeeze=False, sharex="col", sharey="col")
    for axes, (title, table, gap) in zip(grid.ravel(), chain(*parts), strict=True):
        if len(table) and min(column(table, name).min() for name in ACCURACIES) < CHANCE_SEEN:
            axes.axvline(0.5, color="#999999", linewidth=0.9, linestyle="--")
        draw_accuracies(evidence, axes, table, gap)
        axes.set(title=title, xlabel="accuracy of the critic", ylabel=SHORT_GAP)
        axes.tick_params(labelbottom=True)
    return figure


def draw_accuracies(evidence: Evidence, axes: Axes, table: pd.DataFrame, gap: str) -> None:
    """A gap against both accuracies, with r and the p of blocks in the legend, and a line where there are blocks enough."""
    y = column(table, gap)
    for levels, name, colour, marker in zip(LEVELS, ACCURACIES, style.PALETTE, style.MARKERS, strict=False):
        x, found = column(table, name), evidence.correlation(table, name, gap)
        look = {"marker": marker, "color": colour, "label": f"{levels}: {estimate_text(found)}", **DOT}
        axes.scatter(x, y, s=32, zorder=3, **look)
        if np.isfinite(found.low):
            draw_line(axes, x, y, colour)
    axes.margins(y=0.1)
    below = axes.transAxes + ScaledTranslation(0, -0.4, axes.figure.dpi_scale_trans)  # ticks and label [in]
    axes.legend(loc="upper center", bbox_to_anchor=(0.5, 0), bbox_transform=below, handletextpad=0.2, fontsize=8.5)


def figure_5a(evidence: Evidence) -> Drawn:
    """Gap against accuracy per self-supervised algorithm."""
    runs = evidence.results.of("figure_5a")
    if not auxiliary(runs):
        raise NoFigure("no agents with self-supervised losses were trained (`experiments=[figure_5a]`)")
    probed = drawable(accuracies(evidence.results, runs), NO_PROBES)
    table = pick(probed, [*CELL, "algorithm", "probe", *ACCURACIES, "gap", "gap_2022"])
    parts = [
        [(f"{word_for(name)}, {key}", select(table, probe=PROBES[key], algorithm=name), GAPS[key]) for key in METRICS]
        for name in sorted(set(runs["algorithm"]))
    ]
    return Drawn(accuracy_grid(evidence, parts), table)


def figure_5b(evidence: Evidence) -> Drawn:
    """Training curves of the main grid."""
    if evidence.results.curves.empty or evidence.all_results.main.empty:
        raise NoFigure("the curves are not among the tables (`curves.parquet`)")
    curves = evidence.all_results.curves
    chosen = select(curves, name="episode/return").merge(pick(evidence.all_results.main, ["run", *CELL]), on="run")
    chosen = drawable(chosen, "the curves have no returns of training episodes")
    return curves_of_panels(chosen.assign(frames=binned(column(chosen, "frames"))), "training return")


def appendix_sac(evidence: Evidence) -> Drawn:
    """Test return of SAC against frames."""
    runs, curves = evidence.all_results.of("appendix_sac"), evidence.all_results.curves
    if runs.empty or curves.empty:
        raise NoFigure("SAC was not run, or its curves are not among the tables (`experiments=[appendix_sac]`)")
    returns = select(curves, name="evaluation/test/return/deterministic")
    chosen = returns.merge(pick(runs, ["run", "algorithm", *CELL]), on="run")
    drawable(chosen, "the curves have no returns of SAC on test levels")
    return curves_of_panels(chosen, "return on test levels", "algorithm")


def curves_of_panels(curves: pd.DataFrame, y_label: str, *kinds: str) -> Drawn:
    """The means of curves in each panel, with how many runs they are of."""
    table = mean_by(curves, [*kinds, "family", "difficulty", "n", "frames"], ["value"])
    named, runs = with_panel(table), with_panel(curves).groupby("panel", dropna=False)["run"].nunique()
    titles = {panel: f"{panel_name(panel)}, runs: {runs[panel]}" for panel in panels_of(named)}
    return Drawn(figure_of_curves(named, titles, y_label, *kinds), table)


def performance_profiles(evidence: Evidence) -> Drawn:
    """The share of runs that score above each threshold, per algorithm."""
    why = f"no experiment has scores of several algorithms with {FEWEST_UNITS} seeds or more"
    table = drawable(profiles(evidence.all_results, THRESHOLDS), why)
    experiments = list(dict.fromkeys(table["experiment"]))
    colours = style.colours(table["algorithm"])
    figure = new_figure(4.6 * len(experiments), 3.6)
    grid = figure.subplots(1, len(experiments), sharey=True, squeeze=False)[0]
    for axes, experiment in zip(grid, experiments, strict=True):
        for algorithm in sorted(set(select(table, experiment=experiment)["algorithm"])):
            part, look = select(table, experiment=experiment, algorithm=algorithm), {"color": colours[algorithm]}
            at, value, low, high = (column(part, name) for name in ("threshold", "estimate", "low", "high"))
            axes.plot(at, value, linewidth=style.LINE_WIDTH, label=entry(word_for(algorithm)), **look)
            axes.fill_between(at, low, high, alpha=0.14, linewidth=0, **look)
        axes.set(title=COMPARED[experiment], xlabel="score on test levels")
        axes.legend(loc="lower left", fontsize=8.5)
    grid[0].set_ylabel("share of runs above it")
    return Drawn(figure, table)


def appendix_mass(evidence: Evidence) -> Drawn:
    """Gap against accuracy with the mass shown and hidden, by what the agent has of the past."""
    runs = drawable(evidence.results.masses, "appendix_mass", "observation")
    probed = drawable(accuracies(evidence.results, runs), NO_PROBES)
    columns = [*CELL, "past", "mass", "w2_exact", *ACCURACIES, "gap", "success_test_deterministic"]
    table = pick(select(probed, probe=PROBES[METRIC_OURS]), columns)
    parts = []
    for past in (one for one in (FRAME, STACK, MEMORY) if one in set(table["past"])):
        of_mass = {f"{past}, mass {mass}": select(table, past=past, mass=mass) for mass in ("shown", "hidden")}
        parts.append([(title, some, GAPS[METRIC_OURS]) for title, some in of_mass.items()])
    return Drawn(accuracy_grid(evidence, parts), table)
