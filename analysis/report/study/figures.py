"""The figures of a study."""

from collections.abc import Sequence
from itertools import product
from typing import Any

import numpy as np
import pandas as pd

from segar.analysis.gap_plot import gap_plot
from segar.analysis.plotting import style
from segar.analysis.plotting.figures import entry, error_bars, figure_of_panels, legend_below, zero_line
from segar.analysis.report.document.tables import means
from segar.analysis.report.figures.drawing import GAP, Drawn, NoFigure, drawable, figure_of_curves, log_axis
from segar.analysis.report.study.reading import SUCCESS, Study
from segar.analysis.tables import CURVE_POINTS, binned, column, count_of, keep, mean_by, pick, select

ASIDE = 0.09  # between neighbouring lines, as a share of the number of levels


def gap_against_distance(study: Study) -> Drawn:
    """The gap of each run against exact W2."""
    runs = study.runs
    if not np.isfinite(column(runs, study.w2)).any():
        raise NoFigure("no run has its exact W2")
    group = "agent" if len(study.panels) == 1 else "panel"
    group = group if 1 < count_of(runs, group) <= len(style.PALETTE) else None
    # The seed of these rows is that of the level set.
    figure = gap_plot(pick(runs, [one for one in runs if one != "levels.seed"]), study.w2, "gap_deterministic", group)
    table = pick(runs, ["panel", "agent", "n", "seed", study.w2, "gap", "gap_se"])
    caption = "The gap of each run against the exact W2 between its training and test levels."
    return Drawn(figure, table, " ".join(filter(None, [caption, study.about_w2])))


def success(study: Study) -> Drawn:
    """Success on training and test levels."""
    caption = (
        "Success on test levels (filled, solid) and on training levels (hollow, dotted), with 95 % intervals over level sets. "
        "Points are moved sideways, so that they do not cover each other."
    )
    return by_number(study, SUCCESS[::-1], "success", caption)


def gap(study: Study) -> Drawn:
    """The gap by number of training levels."""
    return by_number(study, ["gap"], GAP, "The gap, with 95 % intervals over level sets.")


def by_number(study: Study, values: Sequence[str], label: str, caption: str) -> Drawn:
    """An axes per panel: means against the number of training levels, a line for each kind of agent and each of ``values``.

    The first of the values is filled and solid, the second hollow and dotted. Intervals of shares end at 0 and 1.
    """
    shares = values[0] in SUCCESS
    parts = [means(study.evidence, study.runs, ["panel", "agent", "levels"], one).assign(figure=one) for one in values]
    table = pd.concat(parts)
    if shares:
        table = table.assign(low=table["low"].clip(0, 1), high=table["high"].clip(0, 1))
    lines = list(product(study.agents, values))
    # Of one kind of agents, the values have colours of their own; of several, each kind has one.
    kinds = lines if len(study.agents) == 1 else [(agent, values[0]) for agent, _ in lines]
    colours = dict(zip(lines, (style.PALETTE[list(dict.fromkeys(kinds)).index(kind) % len(style.PALETTE)] for kind in kinds),
                       strict=True))  # fmt: skip
    aside = dict(zip(lines, 1 + ASIDE * (np.arange(len(lines)) - (len(lines) - 1) / 2), strict=True))
    common: dict[str, Any] = {"capsize": 2.5, "elinewidth": 1, "marker": "o", "markersize": 5.5}
    filled, hollow = {**common, "linestyle": "-"}, {**common, "linestyle": ":", "markerfacecolor": "white"}
    figure, grid = figure_of_panels(len(study.panels), 3.7, 3.2, 0.5)
    for axes, panel in zip(grid, study.panels, strict=False):
        for agent, one in lines:
            part = select(table, panel=panel, agent=agent, figure=one)
            at, y = column(part, "levels") * aside[agent, one], column(part, "estimate")
            name = line_name(study, agent, one, values) or None
            look = (filled if one == values[0] else hollow) | {"color": colours[agent, one]}
            axes.errorbar(at, y, yerr=error_bars(part, "estimate"), label=name and entry(name), **look)
        zero_line(axes)
        log_axis(axes, sorted(set(study.runs["n"])))
        axes.set(title=panel, xlabel="training levels")
        if shares:
            axes.set_ylim(-0.05, 1.05)
    grid[0].set_ylabel(label)
    if len(lines) > 1:
        legend_below(figure, grid[0], 2)
    return Drawn(figure, pick(table, ["figure", "panel", "agent", "levels", "estimate", "low", "high"]), caption)


def line_name(study: Study, agent: str, value: str, values: Sequence[str]) -> str:
    """What the legend calls a line."""
    where = {SUCCESS[0]: "training levels", SUCCESS[1]: "test levels"}.get(value, "")
    several = len(study.agents) > 1
    return ", ".join(filter(None, [agent if several else "", where if len(values) > 1 else ""]))


def curves(study: Study) -> Drawn:
    """Training returns against frames, by number of training levels."""
    table = study.evidence.results.curves
    rows = select(table, name="episode/return") if len(table) else table
    drawable(rows, "there are no returns of training episodes")
    known = ["run", "panel", "n", *(["round_frames"] if "round_frames" in study.runs else [])]
    rows = rows.merge(pick(study.runs, known), on="run")
    counts = select(table, name="episode/count")
    caption = "Returns of training episodes, means over agents and seeds. There is a point where all runs of a curve have one."
    if len(counts) and "round_frames" in rows and np.isfinite(column(rows, "round_frames")).all():
        width = max(column(rows, "round_frames").max(), column(rows, "frames").max() / CURVE_POINTS)
        counts = pick(counts, ["run", "frames", "value"]).rename(columns={"value": "episodes"})
        rows = in_rounds(rows.merge(counts, on=["run", "frames"]), width)
        caption += (
            f" It is the mean of the episodes that ended in the {width:,.0f} frames before it. In so many frames every"
            " environment ends an episode; in fewer, short ones count more."
        )
    else:
        rows = rows.assign(frames=binned(column(rows, "frames")))
        rows = mean_by(rows, ["run", "panel", "n", "frames"], ["value"])
    found = mean_by(of_all_runs(rows), ["panel", "n", "frames"], ["value"])
    drawable(found, "no moment of training has a return of all runs of a curve")
    panels = dict(zip(study.panels, study.panels, strict=True))
    return Drawn(figure_of_curves(found, panels, "training return"), found, caption)


def in_rounds(rows: pd.DataFrame, width: float) -> pd.DataFrame:
    """Returns in windows of so many frames: one row per run and window, with the mean ``value`` over its ``episodes``.

    The runs of a curve, those of a panel and a number of levels, have the same windows. The last one ends where the longest of
    them ends. What is left at the beginning is no whole window and is left out: only short episodes have ended there. Runs
    that are shorter than a window have one row.
    """
    curve = ["panel", "n"]
    ends = rows.groupby(curve, dropna=False)["frames"].transform("max").to_numpy(np.float64)
    frames, values, episodes = (column(rows, name) for name in ("frames", "value", "episodes"))
    back = np.floor((ends - frames) / width)
    whole = (back == 0) | ((back + 1) * width <= ends)
    rows = keep(rows.assign(frames=ends - back * width, total=values * episodes), whole)
    found = mean_by(rows, ["run", *curve, "frames"], ["total", "episodes"])
    return found.assign(value=column(found, "total") / column(found, "episodes"))


def of_all_runs(rows: pd.DataFrame) -> pd.DataFrame:
    """The rows, one per run and moment, of the moments at which all runs of a curve have one: a mean of others would jump where
    a run comes in."""
    curve = [rows["panel"], rows["n"]]
    runs = rows.groupby(curve, dropna=False)["run"].transform("nunique")
    there = rows.groupby([*curve, rows["frames"]], dropna=False)["run"].transform("nunique")
    return keep(rows, there == runs)


FIGURES = {draw.__name__: draw for draw in (gap_against_distance, success, gap, curves)}
