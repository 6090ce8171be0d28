"""What the report's figures share: what a figure is, labels of axes, and figures of one axes per family or panel.

All of it is drawn within :func:`segar.analysis.plotting.style.applied`, which the caller enters.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import product

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from segar.analysis.plotting import style
from segar.analysis.plotting.figures import (
    across,
    entry,
    error_bars,
    figure_of_panels,
    legend_below,
    new_figure,
    zero_line,
)
from segar.analysis.plotting.names import panel_name, word_for
from segar.analysis.report.results import panels_of, with_panel
from segar.analysis.stats.resampling import mean_of_units
from segar.analysis.tables import column, count_of, mean_by, select

CELL = ["family", "difficulty", "n", "seed"]
SHORT_GAP = "gap (test − training)"
GAP, GAP_2022 = "gap: return on test − on training levels", "gap, returns of 2022"


@dataclass(frozen=True)
class Drawn:
    """A figure, the numbers in it, and what it shows."""

    figure: Figure
    table: pd.DataFrame
    caption: str = ""  # empty: the one that captions.yaml has under the figure's name


class NoFigure(Exception):
    """A figure cannot be drawn, for the reason that the message says."""


def drawable(table: pd.DataFrame, why: str, varies: str = "") -> pd.DataFrame:
    """The table; raises :class:`NoFigure` where it has no rows, or fewer than two values in the column ``varies``.

    Args:
        why: the reason, or the name of the experiment that was not run.
    """
    if table.empty or (varies and count_of(table, varies) < 2):
        raise NoFigure(why if " " in why else f"it was not run (`experiments=[{why}]`)")
    return table


def success_by_number(table: pd.DataFrame, by: str, lines: Mapping[str, str], y_label: str) -> Figure:
    """An axes per family: mean ``success`` against numbers of training levels, a line per difficulty and value of the column
    ``by``; ``lines`` has the line style of each value."""
    families, difficulties = style.ordered(table["family"]), style.ordered(table["difficulty"])
    colours, markers = style.shades(difficulties), style.markers(difficulties)
    figure = new_figure(2.25 * len(families) + 0.4, 3.4)
    grid = figure.subplots(1, len(families), sharey=True, squeeze=False)[0]
    for axes, family in zip(grid, families, strict=True):
        part = select(table, family=family)
        for name, (kind, line) in product(difficulties, lines.items()):
            means = mean_by(select(part, difficulty=name, **{by: kind}), ["n"], ["success"])
            look = {"color": colours[name], "marker": markers[name], "linestyle": line, "label": f"{name}, {kind}"}
            axes.plot(column(means, "n"), column(means, "success"), **look)
        log_axis(axes, sorted(set(part["n"])))
        axes.set(ylim=(-0.03, 1.03), xlabel="training levels")
        axes.set_title(f"{word_for(family)}, runs: {len(part) // len(lines)}")
    grid[0].set_ylabel(y_label)
    legend_below(figure, grid[0], 3)
    return figure


def log_axis(axes: Axes, counts: Sequence[int]) -> None:
    """A logarithmic axis that has the numbers of levels as its ticks."""
    axes.set_xscale("log")
    axes.set_xticks(list(counts), [str(n) for n in counts], fontsize=8)
    axes.minorticks_off()


def figure_of_curves(table: pd.DataFrame, panels: Mapping[str, str], y_label: str, kinds: str = "") -> Figure:
    """An axes per panel, with its title: ``value`` against ``frames``, a line for each number of training levels, and in a
    style of its own for each of two values of the column ``kinds``."""
    colours = dict(zip(sorted(set(table["n"])), style.SEQUENCE * 3, strict=False))
    lines = dict(zip(style.ordered(table[kinds]), ("-", ":"), strict=False)) if kinds else {"": "-"}
    figure, grid = figure_of_panels(len(panels), 3.1, 2.6, 0.4)
    for axes, (panel, title) in zip(grid, panels.items(), strict=False):
        for (kind, line), (n, colour) in product(lines.items(), colours.items()):
            part = select(table, panel=panel, n=n, **({kinds: kind} if kinds else {}))
            label = ", ".join(filter(None, [word_for(kind), f"{n}"]))
            at, value = column(part, "frames") / 1000, column(part, "value")
            axes.plot(at, value, line, color=colour, linewidth=1.3, marker=".", markersize=3, label=entry(label))
        axes.set(title=title, xlabel="thousand frames")
    grid[0].set_ylabel(y_label)
    legend_below(figure, grid[0], 2 if kinds else 8, "training levels")
    return figure


def draw_means(
    axes: Axes, k: int, x: Sequence[float] | np.ndarray, means: pd.DataFrame, label: str, line: str = "-"
) -> None:
    """Means with their intervals at these places, in the look of the k-th of several series."""
    look = {"marker": style.MARKERS[k], "color": style.PALETTE[k], "capsize": 2.5, "label": label, "linestyle": line}
    axes.errorbar(x, column(means, "estimate"), yerr=error_bars(means, "estimate"), **look)


def unit_means(table: pd.DataFrame, by: str, value: str, least: float = 0.0, most: float = 1.0) -> pd.DataFrame:
    """The mean of ``value`` over the runs with each value of the column ``by``, with its interval, which ends at ``least`` and
    ``most``."""
    groups = table.groupby(by, dropna=False)
    return pd.DataFrame(
        [mean_of_units(column(part, value), "runs", least, most).row(**{by: at}) for at, part in groups]
    )


def dots(table: pd.DataFrame, group: str, y: str, label: str, trained: str = "") -> Figure:
    """One axes per panel, and per value of the column ``trained``: a dot per run, groups side by side, and a bar at the mean of
    several runs with one number of training levels."""
    named = with_panel(table).assign(place=table[trained].astype(str) if trained else "")
    parts = {}
    for panel, place in product(panels_of(named), sorted(set(named["place"]))):
        title = panel_name(panel) + (f",\ntrained in {place}" if trained else "")
        parts[title] = select(named, panel=panel, place=place)
    parts = {title: part for title, part in parts.items() if len(part)}
    groups = sorted(set(map(str, table[group])))
    counts = sorted(set(table["n"]))
    colours = dict(zip(counts, style.SEQUENCE, strict=False))
    figure, grid = figure_of_panels(len(parts), 3.1, 3.1, 0.3)
    for axes, (title, part) in zip(grid, parts.items(), strict=False):
        for k, n in enumerate(counts):
            mine = select(part, n=n)
            at = np.array([groups.index(str(one)) for one in mine[group]]) + 0.14 * (k - (len(counts) - 1) / 2)
            axes.scatter(at, column(mine, y), s=26, color=colours[n], label=f"n = {n}", zorder=3)
            means = mean_by(mine.assign(at=at), ["at"], [y])
            if len(mine) > len(means):
                axes.plot(column(means, "at"), column(means, y), "_", color="#000000", markersize=12, zorder=2)
        zero_line(axes)
        axes.set_xticks(range(len(groups)), groups, rotation=30, ha="right", fontsize=8.5)
        axes.set(xlim=(-0.6, len(groups) - 0.4), title=title)
    for axes in grid[:: across(len(parts))]:
        axes.set_ylabel(label)
    legend_below(figure, grid[0], 6)
    return figure
