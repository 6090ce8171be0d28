"""The figures: a tidy table in, a matplotlib figure out. Nothing here reads or computes anything but the lines."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from analysis import style
from analysis.stats.correlation import Line, NotAvailable, correlate, fit_line
from analysis.tables import column, select
from analysis.words import in_short, in_words
from experiments.atomic import replacing

GAP_LABEL = "gap: return on test − on training levels"


def gap_against_w2(table: pd.DataFrame, modes: Sequence[str], missing: int = 0) -> Figure:
    """The paper's headline: gap against W2, all cells pooled, one axes per W2 mode.

    ``table`` has one row per run with the columns ``family``, ``difficulty``, ``gap``, ``gap_se`` and ``w2_<mode>``;
    ``missing`` runs should be there and are not.
    """
    runs = f"{len(table)} of {len(table) + missing} runs" if missing else f"{len(table)} runs"
    with style.applied():
        figure = new_figure(5.4 * len(modes), 4.9)
        row = figure.subplots(1, len(modes), sharey=True, squeeze=False)[0]
        for axes, mode in zip(row, modes, strict=True):
            x, y = column(table, f"w2_{mode}"), column(table, "gap")
            axes.set_title(f"{mode} W2, {runs}\n{in_words(correlate(x, y))}", loc="left", linespacing=1.4)
            axes.set_xlabel(f"W2 between training and test levels ({mode})")
            draw_points(axes, table, f"w2_{mode}")
            draw_line(axes, x, y)
        row[0].set_ylabel(GAP_LABEL)
        figure.legend(handles=legend_of(table), loc="outside lower center", ncols=6, handletextpad=0.2)
    return figure


def gap_by_family(table: pd.DataFrame, modes: Sequence[str]) -> Figure:
    """The same points split: a column per family, a row per W2 mode, a line per difficulty."""
    families = style.ordered(table["family"])
    with style.applied():
        figure = new_figure(3.9 * len(families), 3.4 * len(modes) + 0.4)
        grid = figure.subplots(len(modes), len(families), squeeze=False)
        for row, mode in zip(grid, modes, strict=True):
            for axes, family in zip(row, families, strict=True):
                axes.set_title(f"{family}, {mode} W2")
                axes.set_xlabel(f"W2 ({mode})")
                draw_difficulties(axes, select(table, family=family), f"w2_{mode}")
            row[0].set_ylabel("gap (test − training)")
    return figure


def draw_difficulties(axes: Axes, table: pd.DataFrame, distance: str) -> None:
    """Points and one line per difficulty, with r and p in the legend."""
    colours, markers = style.shades(table["difficulty"]), style.markers(table["difficulty"])
    for difficulty in style.ordered(table["difficulty"]):
        part = select(table, difficulty=difficulty)
        x, y = column(part, distance), column(part, "gap")
        colour = colours[difficulty]
        look = {"marker": markers[difficulty], "color": colour, "edgecolors": "white", "linewidths": 0.6}
        axes.scatter(x, y, s=42, zorder=3, label=f"{difficulty}: {in_short(correlate(x, y))}", **look)
        line = fit_line(x, y)
        if isinstance(line, Line):
            ends = np.array([x.min(), x.max()])
            axes.plot(ends, line.at(ends), color=colour, linewidth=1.4, zorder=2)
    axes.axhline(0, color="#999999", linewidth=0.8, zorder=1)
    axes.margins(y=0.1)
    axes.locator_params(axis="x", nbins=6)
    axes.legend(loc="upper center", bbox_to_anchor=(0.5, -0.2), handletextpad=0.2, fontsize=9)


def draw_points(axes: Axes, table: pd.DataFrame, distance: str) -> None:
    """One point per run: colour says family, marker says difficulty, a thin bar the standard error of the gap."""
    colours, markers = style.colours(table["family"]), style.markers(table["difficulty"])
    axes.axhline(0, color="#999999", linewidth=0.8, zorder=1)
    for family, difficulty in product(style.ordered(table["family"]), style.ordered(table["difficulty"])):
        part, colour = select(table, family=family, difficulty=difficulty), colours[family]
        x, y = column(part, distance), column(part, "gap")
        bars = {"fmt": "none", "ecolor": colour, "alpha": 0.35, "elinewidth": 1, "zorder": 2}
        axes.errorbar(x, y, yerr=column(part, "gap_se"), **bars)
        look = {"marker": markers[difficulty], "color": colour, "edgecolors": "white", "linewidths": 0.7}
        axes.scatter(x, y, s=46, zorder=3, **look)


def draw_line(axes: Axes, x: np.ndarray, y: np.ndarray) -> None:
    """The least-squares line with the 95 % band of its height."""
    line = fit_line(x, y)
    if isinstance(line, NotAvailable):
        return
    at = np.linspace(x.min(), x.max(), 100)
    height, half = line.at(at), line.half_width(at)
    limits = axes.get_ylim()
    axes.plot(at, height, zorder=4, **style.LINE)
    axes.fill_between(at, height - half, height + half, zorder=1.5, **style.BAND)
    axes.set_ylim(*limits)  # the wide band of a few points would flatten everything else


def legend_of(table: pd.DataFrame) -> list[Line2D]:
    """Legend entries: a dot per family, a grey marker per difficulty."""
    dot = {"linestyle": "none", "markersize": 7.5}
    colours, markers = style.colours(table["family"]), style.markers(table["difficulty"])
    families = [Line2D([], [], marker="o", color=colour, label=name, **dot) for name, colour in colours.items()]
    grey = [Line2D([], [], marker=mark, color="#777777", label=name, **dot) for name, mark in markers.items()]
    return families + grey


def new_figure(width: float, height: float) -> Figure:
    """An empty figure in inches, laid out so that nothing overlaps; no window and no global state."""
    figure = Figure(figsize=(width, height), layout="constrained")
    FigureCanvasAgg(figure)
    return figure


def save_figure(figure: Figure, path: Path) -> list[Path]:
    """Writes ``path`` as .png and .pdf, whole or not at all and the same bytes for the same figure; returns both."""
    written = []
    for suffix, metadata in ((".png", {"Software": None}), (".pdf", {"CreationDate": None, "Producer": None})):
        options: dict[str, Any] = {"format": suffix[1:], "metadata": metadata}
        with style.applied(), replacing(path.with_suffix(suffix)) as beside:
            figure.savefig(beside, **options)
        written.append(path.with_suffix(suffix))
    return written
