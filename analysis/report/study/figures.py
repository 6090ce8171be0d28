"""The figures of a study."""

from collections.abc import Callable, Mapping, Sequence

import numpy as np
import pandas as pd
from matplotlib.axes import Axes

from analysis.gap_plot import gap_plot
from analysis.plotting import style
from analysis.plotting.figures import DOT, zero_line
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
from analysis.report.study.reading import SUCCESS, Study
from analysis.tables import binned, column, count_of, mean_by, pick, select


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
                line, name = ":" if len(values) > 1 and k == 0 else "-", agent if one == values[-1] else ""
                draw_means(axes, part, colours[agent], line, name)
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
    n, middle = column(part, "levels"), column(part, "estimate")
    axes.errorbar(n, middle, yerr=error_bars(part, "estimate"), color=colour, linestyle=line, capsize=2.5)
    axes.scatter(n, middle, color=colour, s=26, zorder=3, label=label or None, **DOT)


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
