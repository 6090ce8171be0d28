"""The figures about the gap and W2: 3a, 3b, 4a, all estimates, and success against the number of levels."""

from itertools import product
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from segar.analysis.plotting import style
from segar.analysis.plotting.figures import DOT, PAGE_WIDTH, error_bars, new_figure, zero_line
from segar.analysis.plotting.names import word_for
from segar.analysis.report.claims.claim import METRIC_2022, METRIC_OURS
from segar.analysis.report.claims.evidence import GIVEN_CELL, Evidence
from segar.analysis.report.claims.specifications import ALL_COUNTS, specifications
from segar.analysis.report.figures.drawing import CELL, GAP, GAP_2022, Drawn, NoFigure, drawable, success_by_number
from segar.analysis.report.number_format import estimate_text, signed
from segar.analysis.tables import column, count_of, keep, pick, select

NO_MAIN_GRID = "there are no runs of the main grid"
METRICS = (
    ("w2_reference", "gap_2022", "W2 of 2022, training to test levels", METRIC_2022, GAP_2022),
    ("w2_exact", "gap", "exact W2, training to test levels", METRIC_OURS, GAP),
)
MEASURES = [name for x, y, *_ in METRICS for name in (x, y)]
TO_AGENTS = "play/"  # begins the addresses of pages of agents, where the report is served
HOLLOW: dict[str, Any] = {"facecolors": "none", "linewidths": 0.9}


def figure_3a(evidence: Evidence) -> Drawn:
    """The headline: gap against W2, a row per metric, an axes per family; hollow where runs did not learn."""
    main = drawable(evidence.all_results.main, NO_MAIN_GRID)
    table = pick(main, [*CELL, *MEASURES, "gap_se", "run"]).assign(
        learned=main["run"].isin(list(evidence.results.main["run"]))
    )
    return Drawn(gaps_against_w2(evidence, table, "difficulty"), table)


def figure_3b(evidence: Evidence) -> Drawn:
    """The same runs, with the correlation of each difficulty."""
    main = drawable(evidence.results.main, NO_MAIN_GRID)
    table = pick(main, [*CELL, *MEASURES])
    return Drawn(gaps_against_w2(evidence, table, "difficulty", by_group=True), table)


def figure_4a(evidence: Evidence) -> Drawn:
    """The same agents on harder levels."""
    harder = drawable(evidence.results.harder, "no agent was tested on harder levels")
    pairs = [f"{a} to {b}" for a, b in zip(harder["difficulty"], harder["test_difficulty"], strict=True)]
    table = pick(harder, [*CELL, *MEASURES]).assign(pair=pairs)
    return Drawn(gaps_against_w2(evidence, table, "pair", by_group=True), table)


def gaps_against_w2(evidence: Evidence, table: pd.DataFrame, group: str, by_group: bool = False) -> Figure:
    """A row per metric, an axes per family; colours are numbers of training levels, markers the values of ``group``. The
    correlations of each of them stand above the axes where they are asked for ``by_group``, else that of all above a row."""
    families, groups, counts = style.ordered(table["family"]), style.ordered(table[group]), sorted(set(table["n"]))
    markers, colours = style.markers(groups), dict(zip(counts, style.SEQUENCE * 3, strict=False))
    figure = new_figure(2.2 * len(families) + 0.6, 6.8)
    parts = list(np.ravel(figure.subfigures(2, 1)))  # type: ignore[arg-type]
    for part, (x, y, x_label, metric, y_label) in zip(parts, METRICS, strict=True):
        title = metric
        if not by_group:
            pooled = evidence.of_main(x.removeprefix("w2_"), y, "pooled")
            title += f", all runs that learned: {estimate_text(pooled)}"
        part.suptitle(title, x=0.01, ha="left", fontsize=10)
        row = part.subplots(1, len(families), squeeze=False, sharex=True, sharey=True)[0]
        for axes, family in zip(row, families, strict=True):
            zero_line(axes)
            said = [word_for(family)]
            for name, n in product(groups, counts):
                cell = select(table, family=family, n=n, **{group: name})
                filled = column(cell, "learned").astype(bool) if "learned" in cell else np.ones(len(cell), bool)
                hollow = {**HOLLOW, "edgecolors": colours[n]}
                for rows, look in ((filled, {"color": colours[n], **DOT}), (~filled, hollow)):
                    some = keep(cell, rows)
                    dots = axes.scatter(column(some, x), column(some, y), s=30, marker=markers[name], zorder=3, **look)
                    dots.set_urls([f"{TO_AGENTS}{run}" for run in some["run"]] if "run" in some else [])
            for name in groups if by_group else ():
                found = evidence.correlation(select(table, family=family, **{group: name}), x, y)
                said += [f"{name}: r = {signed(found.estimate)}"] * bool(np.isfinite(found.low))
            axes.set_title("\n".join(said), fontsize=9)
            axes.set_yscale("symlog", linthresh=1)  # most gaps are small, and those of one level fifty times as large
            axes.yaxis.set_major_formatter("{x:g}")
        part.supxlabel(x_label, fontsize=10)
        row[0].set_ylabel(y_label, fontsize=9)
    dot = {"linestyle": "none", "markersize": 7}
    handles = [Line2D([], [], marker="o", color=colour, label=f"n = {n}", **dot) for n, colour in colours.items()]
    handles += [Line2D([], [], marker=mark, color="#777777", label=name, **dot) for name, mark in markers.items()]
    if "learned" in table:
        handles.append(Line2D([], [], marker="o", color="#999999", mfc="none", label="did not learn", **dot))
    figure.legend(handles=handles, loc="outside lower center", ncols=6, handletextpad=0.2)
    return figure


def train_and_test(evidence: Evidence) -> Drawn:
    """Success on training and on test levels against the number of levels."""
    main = drawable(evidence.all_results.main, NO_MAIN_GRID)
    kinds = {"success_test_deterministic": "test levels", "success_train_deterministic": "training levels"}
    table = pick(main, [*CELL, *reversed(kinds)])
    both = [table.assign(success=table[name], on=words) for name, words in kinds.items()]
    lines = {"test levels": "-", "training levels": ":"}
    return Drawn(success_by_number(pd.concat(both, ignore_index=True), "on", lines, "success"), table)


def specification_curves(evidence: Evidence) -> Drawn:
    """The correlations of three claims in all specifications, in order, with their intervals."""
    table = specifications(evidence)
    claims = {"3a-n": "given panel and n", "3a-cell": "given cell", "4b-none": "given panel and n"}
    claims = {name: words for name, words in claims.items() if len(table) and name in set(table["claim"])}
    if not claims:
        raise NoFigure("nothing varies in these runs")
    table = keep(table, table["claim"].isin(list(claims)))
    choices = zip(table["measure"], table["number of levels"], table["outcome"], strict=True)
    table = table.assign(choice=[", ".join(dict.fromkeys(one)).replace(f", {GIVEN_CELL}", "") for one in choices])
    colours = style.colours(sorted(set(table["outcome"])))
    rows, names = {name: count_of(select(table, claim=name), "choice") for name in claims}, list(claims)
    left = names[:-1] or names  # below each other; the last one stands on the right
    most = max(sum(rows[name] for name in left), rows[names[-1]])
    figure = new_figure(PAGE_WIDTH, 1.4 + 0.5 * len(left) + 0.18 * most)
    places: list[Any] = [[name, names[-1]] for name in left]
    grid = figure.subplot_mosaic(places, height_ratios=[rows[name] + 3 for name in left])
    for name, words in claims.items():
        axes, part = grid[name], select(table, claim=name).sort_values("estimate", ignore_index=True)
        axes.axvline(0, color="#999999", linewidth=0.8)
        order = list(dict.fromkeys([*select(part, runs=ALL_COUNTS)["choice"], *part["choice"]]))
        for (outcome, runs), rows_of in part.groupby(["outcome", "runs"], dropna=False):  # type: ignore[misc]
            at = [order.index(one) + 0.3 * (runs != ALL_COUNTS) for one in rows_of["choice"]]
            look = {"fmt": "o", "color": colours[str(outcome)], "capsize": 2, "markersize": 4}
            look |= {"mfc": "white"} if runs != ALL_COUNTS else {}
            axes.errorbar(column(rows_of, "estimate"), at, xerr=error_bars(rows_of, "estimate"), **look)
        shown = [one.rpartition(", ")[0] for one in order]
        axes.set_yticks(range(len(order)), shown, fontsize=8)
        axes.set(ylim=(-0.7, len(order) - 0.3), xlim=(-1.02, 1.02), xlabel="partial r")
        axes.set_title(f"{name}: {words}", loc="left", fontsize=9)
    dot: dict[str, Any] = {"marker": "o", "linestyle": "none"}
    words = {name: "regret (sign turned)" if name == "regret" else f"gap in {name}" for name in colours}
    handles = [Line2D([], [], color=colour, label=words[name], **dot) for name, colour in colours.items()]
    handles.append(Line2D([], [], color="#777777", mfc="white", label="without n = 1", **dot))
    figure.legend(handles=handles, loc="outside lower center", ncols=4)
    return Drawn(figure, table)
