"""What all figures share: an empty figure, points and lines in one style, and files whose bytes repeat."""

import io
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
from numpy.polynomial import Polynomial
from PIL import Image

from segar.analysis.plotting import style
from segar.analysis.plotting.names import word_for
from segar.analysis.stats.correlation import why_not
from segar.analysis.tables import column, select
from segar.experiments.runs.files import write_bytes

METADATA: dict[str, dict[str, Any]] = {
    ".png": {"Software": None},
    ".pdf": {"CreationDate": None, "Producer": None},
    ".svg": {"Date": None, "Creator": None},
}
DOT: dict[str, Any] = {"edgecolors": "white", "linewidths": 0.6}  # what all scattered dots look like
LINE_POINTS = 6  # fewer have no line: through three points there is nearly always a good one
PAGE_WIDTH = 9.4  # [in] of a figure that is as wide as a page's text; its letters are then three quarters as large
ACROSS = 3  # axes in a row at most, of figures that have one per panel
COLOURS_OF_PNG = 128  # a palette makes files a third as large, and line art does not show it


def new_figure(width: float, height: float) -> Figure:
    """An empty figure in inches, laid out so that nothing overlaps; no window and no global state."""
    figure = Figure(figsize=(width, height), layout="constrained")
    FigureCanvasAgg(figure)
    return figure


def save_figure(figure: Figure, path: Path, suffixes: Sequence[str] = (".png", ".pdf")) -> list[Path]:
    """Writes ``path`` with each suffix, whole or not at all and the same bytes for the same figure; returns the files."""
    for suffix in suffixes:
        stream = io.BytesIO()
        with style.applied():
            figure.savefig(stream, format=suffix[1:], metadata=METADATA[suffix])
        write_bytes(path.with_suffix(suffix), smaller(stream) if suffix == ".png" else stream.getvalue())
    return [path.with_suffix(suffix) for suffix in suffixes]


def smaller(stream: io.BytesIO) -> bytes:
    """A PNG with a palette."""
    out = io.BytesIO()
    with Image.open(stream) as picture:
        flat = picture.convert("RGB").quantize(COLOURS_OF_PNG, dither=Image.Dither.NONE)
        flat.save(out, "PNG", optimize=True)
    return out.getvalue()


def draw_points(axes: Axes, table: pd.DataFrame, x: str, y: str) -> None:
    """One point per row: colour says family, marker says difficulty."""
    colours, markers = style.colours(table["family"]), style.markers(table["difficulty"])
    for family, difficulty in product(style.ordered(table["family"]), style.ordered(table["difficulty"])):
        part = select(table, family=family, difficulty=difficulty)
        look = {"marker": markers[difficulty], "color": colours[family], **DOT}
        axes.scatter(column(part, x), column(part, y), s=36, zorder=3, **look)


def zero_line(axes: Axes) -> None:
    """A thin line at height 0, behind everything."""
    axes.axhline(0, color="#999999", linewidth=0.8, zorder=1)


def draw_line(axes: Axes, x: np.ndarray, y: np.ndarray, colour: str = "#333333") -> None:
    """The least-squares line as far as its points reach; nothing where there is no line, or fewer than six points."""
    if len(x) < LINE_POINTS or why_not(x, y):
        return
    ends = np.array((x.min(), x.max()))
    line = Line2D(ends, Polynomial.fit(x, y, 1)(ends), color=colour, linewidth=style.LINE_WIDTH, zorder=4)
    axes.add_artist(line)  # which leaves the limits to points, those of axes that share them, too


def legend_of(table: pd.DataFrame) -> list[Line2D]:
    """Legend entries: a dot per family, a grey marker per difficulty."""
    dot = {"linestyle": "none", "markersize": 7}
    colours, markers = style.colours(table["family"]), style.markers(table["difficulty"])
    families = [Line2D([], [], marker="o", color=c, label=word_for(name), **dot) for name, c in colours.items()]
    grey = [Line2D([], [], marker=mark, color="#777777", label=name, **dot) for name, mark in markers.items()]
    return families + grey


def entry(name: object) -> str:
    """A name as the label of a legend: matplotlib leaves out labels that begin with an underscore."""
    return f"\u2009{name}" if str(name).startswith("_") else str(name)


def legend_below(figure: Figure, axes: Axes, columns: int, title: str | None = None) -> None:
    """The legend of one of the figure's axes, below all of them."""
    figure.legend(*axes.get_legend_handles_labels(), loc="outside lower center", ncols=columns, title=title)


def error_bars(table: pd.DataFrame, middle: str) -> np.ndarray:
    """How far the columns ``low`` and ``high`` lie from ``middle``, float64 ``[2, rows]``; 0 where there is no interval."""
    y, low, high = (column(table, name) for name in (middle, "low", "high"))
    return np.nan_to_num(np.array([np.maximum(y - low, 0), np.maximum(high - y, 0)]))


def figure_of_panels(count: int, width: float, height: float, below: float) -> tuple[Figure, np.ndarray]:
    """A figure with so many axes, each of this size in inches; ``below`` is for the legend."""
    columns = across(count)
    rows = -(-count // columns)
    figure = new_figure(width * columns, height * rows + below)
    grid = figure.subplots(rows, columns, squeeze=False).ravel()
    for axes in grid[count:]:
        axes.set_visible(False)
    return figure, grid


def across(count: int) -> int:
    """How many of so many axes stand in a row."""
    return 2 if count == 4 else min(count, ACROSS)
