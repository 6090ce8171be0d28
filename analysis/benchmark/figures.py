"""The figure of the benchmark: the profile over the axes."""

from collections.abc import Sequence
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from segar.analysis.benchmark.causes import EFFECT
from segar.analysis.benchmark.scores import DRAWN, OVERALL, PRACTICE
from segar.analysis.plotting import style
from segar.analysis.plotting.figures import entry, error_bars, legend_below, new_figure, zero_line
from segar.analysis.tables import column, select
from segar.experiments.benchmarking.protocol import REFERENCES

SPREAD = 0.6  # of the width of an axis, over which rows stand side by side
PROFILED = {
    DRAWN: "above chance, drawn",
    PRACTICE: "above chance, practice",
    "score": "score",
    EFFECT: "gained on twins",
}


def shown_rows(board: pd.DataFrame) -> list[str]:
    """The rows that figures show: those that are no references."""
    overall = select(board, axis=OVERALL, quantity=PRACTICE)
    return [row for row in overall["row"] if row not in REFERENCES]


def profile_figure(board: pd.DataFrame, rows: Sequence[str], axes_names: Sequence[str]) -> Figure:
    """The mean success above chance and score of each row on each axis, with intervals over seeds, and what success gains on
    causal twins in which all that differs is as in training; 0 and 1 are lines."""
    with style.applied():
        figure = new_figure(1.05 * len(axes_names) + 1.2, 11.0)
        panels = figure.subplots(len(PROFILED), 1, sharex=True)
        for axes, (quantity, label) in zip(panels, PROFILED.items(), strict=True):
            _draw_profile(axes, select(board, quantity=quantity), rows, axes_names)
            axes.set_ylabel(label)
        legend_below(figure, panels[0], 3)
    return figure


def _draw_profile(axes: Axes, board: pd.DataFrame, rows: Sequence[str], axes_names: Sequence[str]) -> None:
    """One quantity: rows side by side on each axis."""
    colours, markers = _looks(rows)
    for i, row in enumerate(rows):
        part = select(board, row=row).set_index("axis").reindex(list(axes_names)).reset_index()
        place = np.arange(len(axes_names)) + SPREAD * ((i + 0.5) / len(rows) - 0.5)
        look: dict[str, Any] = {"fmt": markers[row], "color": colours[row], "markersize": 6, "elinewidth": 1.2}
        axes.errorbar(place, column(part, "estimate"), yerr=error_bars(part, "estimate"), label=entry(row), **look)
    zero_line(axes)
    axes.axhline(1, color="#999999", linewidth=0.8, zorder=1)
    for edge in np.arange(len(axes_names) - 1) + 0.5:
        axes.axvline(edge, color="#dddddd", linewidth=0.8, zorder=0)
    axes.grid(axis="x", visible=False)
    axes.set_xticks(range(len(axes_names)), list(axes_names))
    axes.set_xlim(-0.5, len(axes_names) - 0.5)


def _looks(rows: Sequence[str]) -> tuple[dict[str, str], dict[str, str]]:
    """A colour and a marker for each row, of which no two of 49 rows have the same."""
    ordered = sorted(rows)
    colours = {row: style.PALETTE[i % len(style.PALETTE)] for i, row in enumerate(ordered)}
    rounds = {row: i + i // len(style.PALETTE) for i, row in enumerate(ordered)}
    return colours, {row: style.MARKERS[i % len(style.MARKERS)] for row, i in rounds.items()}
