"""The figures about the gap and W2: 3a, 3b, 4a, all estimates, and success against the number of levels."""

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from analysis.plotting import style
from analysis.plotting.figures import DOT, draw_line, draw_points, legend_of, new_figure, zero_line
from analysis.report.claims.evidence import BLOCKS, DISTANCES, GIVEN, Evidence, design, pearson
from analysis.report.figures.drawing import CELL, GAP, GAP_2022, Drawn, error_bars, figure_of_families, legend_below
from analysis.report.number_format import estimate_text
from analysis.stats.correlation import residuals
from analysis.tables import column, keep, mean_by, pick, select

NO_MAIN_GRID = "there are no runs of the main grid"
LEFT = "gap, what is left"
W2_2022, W2_EXACT = "W2 of 2022, training to test levels", "exact W2, training to test levels"


def figure_3a(evidence: Evidence) -> Drawn | str:
    """The headline: as in the paper, corrected, and what is left given panel and log n."""
    main = evidence.main
    if main.empty:
        return NO_MAIN_GRID
    left_x, left_y = (left_of(main, name) for name in ("w2_exact", "gap"))
    table = pick(main, [*CELL, "w2_reference", "gap_2022", "w2_exact", "gap", "gap_se"]).assign(
        w2_exact_left=left_x, gap_left=left_y
    )
    figure = new_figure(11.4, 4.4)
    axes = figure.subplots(1, 3)
    exact = evidence.association("exact", "gap", "pooled")
    given = evidence.association("exact", "gap", "given panel and log n")
    paper = evidence.association("reference", "gap_2022", "pooled")
    sets = (
        ("as in the paper", paper, "w2_reference", "gap_2022", "", W2_2022, GAP_2022),
        ("corrected", exact, "w2_exact", "gap", "gap_se", W2_EXACT, GAP),
        ("corrected, given panel and log n", given, "w2_exact_left", "gap_left", "", "exact W2, what is left", LEFT),
    )
    for one, (title, found, x, y, error, x_label, y_label) in zip(axes, sets, strict=True):
        zero_line(one)
        draw_points(one, table, x, y, error)
        draw_line(one, column(table, x), column(table, y))
        one.set_title(f"{title}\n{estimate_text(found)}", loc="left", fontsize=9.5, linespacing=1.4)
        one.set_xlabel(x_label)
        one.set_ylabel(y_label)
    figure.legend(handles=legend_of(table), loc="outside lower center", ncols=6, handletextpad=0.2)
    return Drawn(figure, table)


def left_of(table: pd.DataFrame, name: str) -> np.ndarray:
    """What least squares on panel and log n leaves of a column."""
    return residuals(column(table, name), design(table, ("panel", "log_n")))


def figure_3b(evidence: Evidence) -> Drawn | str:
    """The same points by family, a line per difficulty."""
    main = evidence.main
    if main.empty:
        return NO_MAIN_GRID
    table = pick(main, [*CELL, "w2_reference", "gap_2022", "w2_exact", "gap"])
    figure = by_family(table, "difficulty")
    return Drawn(figure, table)


def figure_4a(evidence: Evidence) -> Drawn | str:
    """The same agents on harder levels."""
    harder = evidence.results.harder
    if harder.empty:
        return "no agent was tested on harder levels"
    pairs = [f"{a} to {b}" for a, b in zip(harder["difficulty"], harder["test_difficulty"], strict=True)]
    table = pick(harder, [*CELL, "w2_reference", "gap_2022", "w2_exact", "gap"]).assign(pair=pairs)
    figure = by_family(table, "pair")
    return Drawn(figure, table)


def by_family(table: pd.DataFrame, group: str) -> Figure:
    """Two rows (paper's settings, corrected), a column per family, a line per value of ``group``."""
    families = style.ordered(table["family"])
    rows = (("w2_reference", "gap_2022", W2_2022, "as in the paper\n" + GAP_2022),
            ("w2_exact", "gap", W2_EXACT, "corrected\n" + GAP))  # fmt: skip
    figure = new_figure(3.7 * len(families) + 0.3, 7.6)
    grid = figure.subplots(2, len(families), squeeze=False)
    for axes_row, (x, y, x_label, y_label) in zip(grid, rows, strict=True):
        for axes, family in zip(axes_row, families, strict=True):
            axes.set_title(family)
            axes.set_xlabel(x_label)
            draw_groups(axes, select(table, family=family), x, y, group)
        axes_row[0].set_ylabel(y_label)
    return figure


def draw_groups(axes: Axes, table: pd.DataFrame, x: str, y: str, group: str) -> None:
    """Points and a line per group, with r and p in the legend."""
    zero_line(axes)
    colours, markers = style.shades(table[group]), style.markers(table[group])
    for name in style.ordered(table[group]):
        part = select(table, **{group: name})
        found = pearson(part, x, y)
        look = {"marker": markers[name], "color": colours[name], **DOT}
        axes.scatter(column(part, x), column(part, y), s=36, zorder=3, label=f"{name}: {estimate_text(found)}", **look)
    axes.margins(y=0.1)
    for name in style.ordered(table[group]):  # lines keep to the limits that all points made
        part = select(table, **{group: name})
        draw_line(axes, column(part, x), column(part, y), colours[name], band=False)
    axes.locator_params(axis="x", nbins=6)
    axes.legend(loc="upper center", bbox_to_anchor=(0.5, -0.2), handletextpad=0.2, fontsize=8)


def estimates(evidence: Evidence) -> Drawn | str:
    """All correlations of gap and W2 at a glance: what is given against which distance."""
    if evidence.main.empty or not evidence.modes:
        return NO_MAIN_GRID
    found = select(evidence.resampled, way=BLOCKS)
    table = pick(found, ["w2", "gap", "test", "estimate", "low", "high", "n", "p"])
    table = keep(table, np.isfinite(column(table, "estimate")))  # one seed leaves nothing within cells
    tests = [test for test in GIVEN if test in set(table["test"])]
    colours = dict(zip(DISTANCES, style.PALETTE, strict=False))
    figure = new_figure(8.6, 3.9)
    axes = figure.subplots(1, 2, sharey=True)
    for one, (gap, title) in zip(axes, (("gap_2022", "returns of 2022"), ("gap", "full returns")), strict=True):
        one.axvline(0, color="#999999", linewidth=0.8)
        for k, mode in enumerate(evidence.modes):
            part = select(table, gap=gap, w2=mode)
            at = np.array([tests.index(test) for test in part["test"]]) + 0.2 * (k - 1)
            look = {"fmt": style.MARKERS[k], "color": colours[mode], "capsize": 2.5, "markersize": 5.5}
            bars = error_bars(part, "estimate")
            one.errorbar(column(part, "estimate"), at, xerr=bars, label=DISTANCES[mode], **look)
        one.set_yticks(range(len(tests)), tests)
        one.set_xlim(-1.02, 0.62)
        one.set_title(title)
        one.set_xlabel("correlation of gap and W2")
    axes[0].invert_yaxis()
    legend_below(figure, axes[0], 3)
    return Drawn(figure, table)


def train_and_test(evidence: Evidence) -> Drawn | str:
    """Success on training and on test levels against the number of levels."""
    main = evidence.main
    if main.empty:
        return NO_MAIN_GRID
    kinds = {"success_train_deterministic": "training levels", "success_test_deterministic": "test levels"}
    table = pick(main, [*CELL, *kinds])
    figure = figure_of_families(table, "success", draw_success)
    colours, markers = style.shades(table["difficulty"]), style.markers(table["difficulty"])
    handles = [Line2D([], [], color=colours[name], marker=markers[name], label=name) for name in colours]
    handles.append(Line2D([], [], linestyle="-", label="test levels", color="#777777"))
    handles.append(Line2D([], [], linestyle=":", label="training levels", color="#777777"))
    figure.legend(handles=handles, loc="outside lower center", ncols=5)
    return Drawn(figure, table)


def draw_success(axes: Axes, table: pd.DataFrame) -> None:
    """Two lines per difficulty."""
    colours, markers = style.shades(table["difficulty"]), style.markers(table["difficulty"])
    for name in style.ordered(table["difficulty"]):
        values = ("success_train_deterministic", "success_test_deterministic")
        means = mean_by(select(table, difficulty=name), ["n"], values)
        n = column(means, "n")
        axes.plot(n, column(means, "success_test_deterministic"), color=colours[name], marker=markers[name])
        axes.plot(n, column(means, "success_train_deterministic"), color=colours[name], linestyle=":")
    axes.set_ylim(-0.03, 1.03)
