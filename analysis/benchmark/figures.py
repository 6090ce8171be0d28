"""Figures of the benchmark: the profile over the axes, and performance profiles."""

from collections.abc import Sequence

import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from analysis.benchmark.scores import OVERALL
from analysis.plotting import style
from analysis.plotting.figures import new_figure, zero_line
from analysis.tables import column, select
from experiments.benchmarking.protocol import REFERENCES

SPREAD = 0.6  # of the width of an axis, over which rows stand side by side
FLOOR = -0.35  # lower ends of intervals are cut there


def profile_figure(board: pd.DataFrame, rows: Sequence[str], axes_names: Sequence[str]) -> Figure:
    """The interquartile mean of the score of each row on each axis, with its interval; 0 and 1 are lines."""
    colours, markers = _looks(rows)
    with style.applied():
        figure = new_figure(1.05 * len(axes_names) + 1.2, 3.9)
        axes = figure.subplots()
        for i, row in enumerate(rows):
            part = select(board, row=row).set_index("axis").reindex(list(axes_names)).reset_index()
            place = np.arange(len(axes_names)) + SPREAD * ((i + 0.5) / len(rows) - 0.5)
            y, low, high = (column(part, name) for name in ("estimate", "low", "high"))
            bars = np.nan_to_num(np.array([np.maximum(y - np.maximum(low, FLOOR), 0), np.maximum(high - y, 0)]))
            axes.errorbar(
                place, y, yerr=bars, fmt=markers[row], color=colours[row], markersize=6, elinewidth=1.2, label=row
            )  # fmt: skip
        zero_line(axes)
        axes.axhline(1, color="#999999", linewidth=0.8, zorder=1)
        for edge in np.arange(len(axes_names) - 1) + 0.5:
            axes.axvline(edge, color="#dddddd", linewidth=0.8, zorder=0)
        axes.grid(axis="x", visible=False)
        axes.set_xticks(range(len(axes_names)), ["all" if name == OVERALL else name for name in axes_names])
        axes.set_xlim(-0.5, len(axes_names) - 0.5)
        axes.set_ylabel("score on test levels (IQM)")
        _legend(figure, axes)
    return figure


def performance_figure(shares: pd.DataFrame, rows: Sequence[str]) -> Figure:
    """The share of runs, over all suites, whose score is above each threshold, with intervals of each point."""
    colours, _ = _looks(rows)
    with style.applied():
        figure = new_figure(5.6, 3.9)
        axes = figure.subplots()
        for row in rows:
            part = select(shares, row=row)
            at = column(part, "threshold")
            axes.plot(at, column(part, "estimate"), color=colours[row], linewidth=style.LINE_WIDTH, label=row)
            axes.fill_between(
                at, column(part, "low"), column(part, "high"), color=colours[row], alpha=0.13, linewidth=0
            )
        axes.set_xlabel("score on test levels")
        axes.set_ylabel("share of runs above it")
        axes.set_ylim(-0.02, 1.02)
        _legend(figure, axes)
    return figure


def shown_rows(board: pd.DataFrame) -> list[str]:
    """The rows that figures show, best first: those that are no references."""
    overall = select(board, axis=OVERALL)
    return [row for row in overall["row"] if row not in REFERENCES]


def _looks(rows: Sequence[str]) -> tuple[dict[str, str], dict[str, str]]:
    ordered = sorted(rows)
    colours = {row: style.PALETTE[i % len(style.PALETTE)] for i, row in enumerate(ordered)}
    return colours, {row: style.MARKERS[i % len(style.MARKERS)] for i, row in enumerate(ordered)}


def _legend(figure: Figure, axes: object) -> None:
    handles, labels = axes.get_legend_handles_labels()  # type: ignore[attr-defined]
    figure.legend(handles, labels, loc="outside lower center", ncols=3)
