"""The figures about the gap and W2: 3a, 3b, 4a, all estimates, and success against the number of levels."""

from collections import Counter
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from analysis.plotting import style
from analysis.plotting.figures import PAGE_WIDTH, draw_line, draw_points, error_bars, legend_of, new_figure, zero_line
from analysis.plotting.names import word_for
from analysis.report.claims.claim import METRIC_2022, METRIC_OURS
from analysis.report.claims.evidence import GIVEN_CELL, Evidence
from analysis.report.claims.specifications import specifications
from analysis.report.figures.drawing import (
    CELL,
    GAP,
    GAP_2022,
    SHORT_GAP,
    Drawn,
    Related,
    draw_related,
    success_by_number,
)
from analysis.report.number_format import estimate_text
from analysis.tables import column, pick, select

NO_MAIN_GRID = "there are no runs of the main grid"
W2_2022, W2_EXACT = "W2 of 2022, training to test levels", "exact W2, training to test levels"
METRICS = (
    ("w2_reference", "gap_2022", W2_2022, METRIC_2022, GAP_2022),
    ("w2_exact", "gap", W2_EXACT, METRIC_OURS, GAP),
)
NOT_LEARNED: dict[str, Any] = {"facecolors": "none", "edgecolors": "#999999", "linewidths": 0.9}


def figure_3a(evidence: Evidence) -> Drawn | str:
    """The headline: gap against W2, a row per metric, an axes per family; the line is that of all runs that learned."""
    main = evidence.ungated.main
    if main.empty:
        return NO_MAIN_GRID
    learned = main["run"].isin(list(evidence.main["run"]))
    names = [*CELL, "w2_reference", "gap_2022", "w2_exact", "gap", "gap_se"]
    table = pick(main, names).assign(learned=learned)
    families = style.ordered(main["family"])
    figure = new_figure(2.2 * len(families) + 0.6, 6.8)
    parts = list(np.ravel(figure.subfigures(2, 1)))  # type: ignore[arg-type]
    kept = select(table, learned=True)
    for part, (x, y, x_label, metric, y_label) in zip(parts, METRICS, strict=True):
        found = evidence.of_main(x.removeprefix("w2_"), y, "pooled")
        part.suptitle(f"{metric}, all runs that learned: {estimate_text(found)}", x=0.01, ha="left", fontsize=10)
        row = part.subplots(1, len(families), squeeze=False)[0]
        for axes, family in zip(row, families, strict=True):
            draw_family(axes, select(table, family=family), x, y)
            draw_line(axes, column(kept, x), column(kept, y), across=True)
            axes.set_title(word_for(family))
        part.supxlabel(x_label, fontsize=10)
        row[0].set_ylabel(y_label, fontsize=9)
    handles = [*legend_of(select(table, learned=True)), not_learned_entry()]
    figure.legend(handles=handles, loc="outside lower center", ncols=4, handletextpad=0.2)
    return Drawn(figure, table)


def draw_family(axes: Axes, table: pd.DataFrame, x: str, y: str) -> None:
    """The runs of a family; hollow where they did not learn."""
    zero_line(axes)
    draw_points(axes, select(table, learned=True), x, y, "gap_se" if y == "gap" else "")
    failed = select(table, learned=False)
    axes.scatter(column(failed, x), column(failed, y), s=30, zorder=2, **NOT_LEARNED)
    axes.margins(0.08)


def not_learned_entry() -> Line2D:
    """The legend's entry of runs below the gate."""
    look = {"linestyle": "none", "marker": "o", "markerfacecolor": "none", "markersize": 6}
    return Line2D([], [], color="#999999", label="did not learn its training levels", **look)


def figure_3b(evidence: Evidence) -> Drawn | str:
    """The same runs, a line per difficulty."""
    main = evidence.main
    if main.empty:
        return NO_MAIN_GRID
    table = pick(main, [*CELL, "w2_reference", "gap_2022", "w2_exact", "gap"])
    return Drawn(by_family(evidence, table, "difficulty"), table)


def figure_4a(evidence: Evidence) -> Drawn | str:
    """The same agents on harder levels."""
    harder = evidence.results.harder
    if harder.empty:
        return "no agent was tested on harder levels"
    pairs = [f"{a} to {b}" for a, b in zip(harder["difficulty"], harder["test_difficulty"], strict=True)]
    table = pick(harder, [*CELL, "w2_reference", "gap_2022", "w2_exact", "gap"]).assign(pair=pairs)
    return Drawn(by_family(evidence, table, "pair"), table)


def by_family(evidence: Evidence, table: pd.DataFrame, group: str) -> Figure:
    """A row per family, a column per metric, a line per value of ``group``."""
    families = style.ordered(table["family"])
    figure = new_figure(8.6, 2.9 * len(families) + 0.2)
    grid = figure.subplots(len(families), len(METRICS), squeeze=False)
    for axes_row, family in zip(grid, families, strict=True):
        for axes, (x, y, x_label, metric, y_label) in zip(axes_row, METRICS, strict=True):
            axes.set_title(f"{word_for(family)}, {metric}")
            axes.set_xlabel(x_label)
            axes.set_ylabel(SHORT_GAP if y_label == GAP else y_label, fontsize=9)
            draw_groups(evidence, axes, select(table, family=family), x, y, group)
    return figure


def draw_groups(evidence: Evidence, axes: Axes, table: pd.DataFrame, x: str, y: str, group: str) -> None:
    """Points and a line per group."""
    zero_line(axes)
    colours, markers = style.shades(table[group]), style.markers(table[group])
    parts = {name: select(table, **{group: name}) for name in style.ordered(table[group])}
    related = [Related(name, part, x, y, colours[name], markers[name]) for name, part in parts.items()]
    draw_related(evidence, axes, related, 36)
    axes.locator_params(axis="x", nbins=6)


def train_and_test(evidence: Evidence) -> Drawn | str:
    """Success on training and on test levels against the number of levels."""
    main = evidence.ungated.main
    if main.empty:
        return NO_MAIN_GRID
    kinds = {"success_test_deterministic": "test levels", "success_train_deterministic": "training levels"}
    table = pick(main, [*CELL, *reversed(kinds)])
    both = [table.assign(success=table[name], on=words) for name, words in kinds.items()]
    lines = {"test levels": "-", "training levels": ":"}
    return Drawn(success_by_number(pd.concat(both, ignore_index=True), "on", lines, "success"), table)


def specification_curves(evidence: Evidence) -> Drawn | str:
    """The correlations of three claims in all specifications, in order, with their intervals."""
    table = specifications(evidence)
    if table.empty:
        return "nothing varies in these runs"
    claims = {"3a-n": "given panel and n", "3a-cell": "given cell", "4b-none": "given panel and n"}
    claims = {name: words for name, words in claims.items() if name in set(table["claim"])}
    colours = style.colours(sorted(set(table["outcome"])))
    rows, names = Counter(table["claim"]), list(claims)
    left = names[:-1] or names  # below each other; the last one stands on the right
    most = max(sum(rows[name] for name in left), rows[names[-1]])
    figure = new_figure(PAGE_WIDTH, 1.4 + 0.5 * len(left) + 0.18 * most)
    places: list[Any] = [[name, names[-1]] for name in left]
    grid = figure.subplot_mosaic(places, height_ratios=[rows[name] + 3 for name in left])
    for name, words in claims.items():
        axes, part = grid[name], select(table, claim=name).sort_values("estimate", ignore_index=True)
        axes.axvline(0, color="#999999", linewidth=0.8)
        for outcome, rows_of in part.groupby("outcome", dropna=False):
            look = {"fmt": "o", "color": colours[str(outcome)], "capsize": 2, "markersize": 4}
            axes.errorbar(column(rows_of, "estimate"), rows_of.index, xerr=error_bars(rows_of, "estimate"), **look)
        choices = [
            ", ".join(dict.fromkeys((row["measure"], row["number of levels"], *["n > 1"] * (row["runs"] != "all"))))
            for row in part.to_dict("records")
        ]
        shown = [one.replace(f", {GIVEN_CELL}", "") for one in choices]
        axes.set_yticks(range(len(part)), shown, fontsize=8)
        axes.set_ylim(-0.7, len(part) - 0.3)
        axes.set_xlim(-1.02, 1.02)
        axes.set_xlabel("partial r")
        axes.set_title(f"{name}: {words}", loc="left", fontsize=9)
    handles = [Line2D([], [], marker="o", linestyle="none", color=c, label=f"gap in {name}" if name != "regret" else
                      "regret (sign turned)") for name, c in colours.items()]  # fmt: skip
    figure.legend(handles=handles, loc="outside lower center", ncols=3)
    return Drawn(figure, table)
