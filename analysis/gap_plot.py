"""``segar gap-plot RUNS -o gap.png``: the gap of any runs against their distance, with the correlation.

``RUNS`` are folders that hold run folders; without any, ``runs/`` of the checkout. Each point is a run with the 95 %
interval of its gap over episodes, or with ``--cells`` the mean of the runs that differ by their seeds alone, with its
interval over level sets. Where runs have several pairs of training and test distributions, W2 is measured in one unit for all
of them. A warning says where the runs were made by different code, or where level sets share levels.
"""

import dataclasses
import textwrap
from pathlib import Path
from typing import cast

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from segar.analysis.distances import COMMON, count_pairs, in_one_unit, own_levels
from segar.analysis.plotting import style
from segar.analysis.plotting.figures import (
    DOT,
    METADATA,
    draw_line,
    entry,
    error_bars,
    legend_below,
    new_figure,
    save_figure,
    zero_line,
)
from segar.analysis.runs import (
    LEVEL_SETS,
    about_level_sets,
    column_name,
    finished,
    names_of,
    number_column,
    number_of_pairs,
    read_runs,
    settings_varied,
    summarise,
    training_sets,
)
from segar.analysis.stats.correlation import correlate, indicators
from segar.analysis.stats.estimate import Estimate
from segar.analysis.stats.resampling import by_blocks, partial
from segar.analysis.tables import column, count_of, pick, select
from segar.errors import SegarError
from segar.experiments.commands.command_line import run_from_command_line
from segar.experiments.reproduction.experiment_file import FEWEST_BLOCKS
from segar.experiments.runs.run_rows import code_warning, run_rows, seen_warning
from segar.support import counted

NORMAL = 1.96  # standard errors of a 95 % interval
MOST_GROUPS = len(style.PALETTE)  # colours that readers can tell apart
# Settings that colours show: the first of them that varies.
PREFERRED = ("levels.train", "family", "algorithm.name", "algorithm", "levels.count", "n")
# Settings in tables that do not say which columns are settings.
CELL = ("family", "difficulty", "n", "variation", "design", "agent")
TITLE_WIDTH = 84  # characters that fit above the axes
GAP = "gap (return on test − on training levels)"
TITLES = {
    "w2_exact": "W2 between training and test levels",
    COMMON: "W2 between training and test levels, in one unit for all",
    "w2_reference": "W2 of 2022 between training and test levels",
    "ks": "Kolmogorov-Smirnov statistic of training and test levels",
    "gap_deterministic": GAP,
    "gap_sampled": f"{GAP}, sampled actions",
    "levels.count": "number of training levels",
}


def gap_plot(
    runs: pd.DataFrame | str | Path,
    x: str = "w2",
    y: str = "gap",
    group: str | None = None,
    path: str | Path | None = None,
    cells: bool = False,
) -> Figure:
    """A scatter plot of two columns of runs, with their correlation and its 95 % interval over level sets.

    Args:
        runs: a table of :func:`segar.analysis.runs.read_runs`, or a folder of runs; runs that are not finished do not count.
        x, y: columns, or short names: ``w2`` (exact; of several pairs of distributions in one unit, if the level files of all
            runs are there), ``ks``, ``gap``, ``success_test``, ``count``.
        group: the column that colours show, with at most seven values; None: the levels, else the algorithm, else another
            setting that varies.
        path: where the figure is written, as ``.png``, ``.pdf`` or ``.svg``; whole or not at all.
        cells: draw the mean of the runs that differ by their seeds alone, instead of each run.

    Raises:
        SegarError: a column does not exist or holds text, no run has both figures, or the file cannot be written.
    """
    if path is not None and Path(path).suffix not in METADATA:
        raise SegarError(f"'{path}' ends in none of {', '.join(METADATA)}, which say what is written")
    table = runs if isinstance(runs, pd.DataFrame) else read_runs(runs)
    asked, (x, y) = x, (number_column(table, name) for name in (x, y))
    done = finished(table)
    both = cast(pd.DataFrame, done[done[[x, y]].notna().all(axis=1)]).reset_index(drop=True)
    if both.empty:
        raise SegarError(f"no finished run has both {x} and {y}")
    both, about_unit = _with_unit(both, x, asked)
    x = COMMON if COMMON in both and asked == "w2" else x
    group = next(iter(_groups(both)), None) if group is None else column_name(both, group)
    shown = both.assign(group="all runs" if group is None else both[group])
    if not pd.api.types.is_any_real_numeric_dtype(shown["group"]):
        shown["group"] = shown["group"].map(str)
    if (count := count_of(shown, "group")) > MOST_GROUPS:
        raise SegarError(f"group: {group} has {count} values, and {MOST_GROUPS} colours can be told apart")
    points = _cells(shown, x, y) if cells else _runs(shown, x, y)
    with style.applied():
        figure = new_figure(6.2, 4.6)
        axes = figure.subplots()
        _draw(axes, points)
        found = correlation(shown, x, y)
        if found.low > 0 or found.high < 0:  # a line says that there is something
            draw_line(axes, column(points, "x"), column(points, "y"))
        axes.set(xlabel=TITLES.get(x, x), ylabel=TITLES.get(y, y))
        of = "r of the runs" if cells else "r"
        lines = [_counts(shown, points, len(table) - len(both), cells), *([_of_means(points)] if cells else [])]
        lines.append(f"{of} = {_in_words(found)}")
        if count_of(shown, "group") > 1:
            lines.append(f"{of} given the groups = {_in_words(correlation(shown, x, y, 'group'))}")
        by = settings_varied(shown) if "state" in shown else [name for name in CELL if name in shown]
        in_cells = shown.assign(cell=names_of(shown, by))
        if count_of(shown, "group") < count_of(in_cells, "cell"):
            lines.append(f"{of} given all settings but seeds = {_in_words(correlation(in_cells, x, y, 'cell'))}")
        lines += [*about_level_sets(shown, by=()), *_warnings(shown), *about_unit]
        wrapped = (part for line in lines for part in textwrap.wrap(line, TITLE_WIDTH))
        axes.set_title("\n".join(wrapped), loc="left", fontsize=9)
        if group is not None:
            legend_below(figure, axes, 4, group)
    if path is not None:
        path = Path(path).expanduser().resolve()
        save_figure(figure, path, (path.suffix,))
    return figure


def correlation(runs: pd.DataFrame, x: str, y: str, given: str | None = None) -> Estimate:
    """Pearson's r of two columns, given the groups of a third one, with the 95 % interval and p over level sets.

    All runs that were trained on a level set stay together, whatever they are tested on: level sets are left out one at a
    time (jackknife), and fewer than 3 have no interval. ``n`` counts level sets. ``note`` says how the interval was made, or
    why there is none.
    """
    x, y = column_name(runs, x), column_name(runs, y)
    groups = None if given is None else indicators([str(value) for value in runs[given]])
    at, of = column(runs, x), column(runs, y)
    whole = correlate(at, of, groups).pearson
    if not np.isfinite(whole.estimate):
        return whole
    values = np.column_stack([at, of, np.ones(len(runs)), *([] if groups is None else [groups])])
    blocks = pd.DataFrame({"block": training_sets(runs)})
    found = by_blocks(blocks, partial, ["block"], FEWEST_BLOCKS, LEVEL_SETS, values=values, correlation=True)
    return dataclasses.replace(found, note=found.note or f"{found.n} level sets, left out one at a time")


def _with_unit(runs: pd.DataFrame, x: str, asked: str) -> tuple[pd.DataFrame, list[str]]:
    """The runs, with :data:`COMMON` where W2 was asked for in short and they are of several pairs of distributions; and
    what a reader has to know of the unit, in sentences."""
    if x != "w2_exact" or number_of_pairs(runs) == 1:
        return runs, []
    why = "--x w2 has one unit for all"
    if asked == "w2":
        try:
            if "folder" not in runs:
                raise SegarError("the table does not say where level files are")
            measured = [own_levels(Path(folder)) for folder in runs["folder"]]
            if count_pairs(measured) == 1:
                return runs, []
            return runs.assign(**{COMMON: in_one_unit(measured)}), []
        except SegarError as error:
            why = f"there is none for all, because {error}"
    text = f"W2 has a unit for each pair of training and test distributions: compare it within a pair; {why}"
    return runs, [text]


def _warnings(runs: pd.DataFrame) -> list[str]:
    """What :mod:`segar.experiments.runs.run_rows` warns of, if the table says where the runs are."""
    places = [path for path in map(Path, runs["folder"]) if path.is_dir()] if "folder" in runs else []
    rows = run_rows(places)
    return [code_warning(rows), seen_warning(rows)]


def _groups(runs: pd.DataFrame) -> list[str]:
    """The settings that colours can show, the preferred ones first: those that vary, and not too much."""
    varied = settings_varied(runs) if "state" in runs else [name for name in PREFERRED if name in runs]
    fitting = [name for name in varied if 1 < len(set(map(str, runs[name]))) <= MOST_GROUPS]
    return list(dict.fromkeys(name for name in (*PREFERRED, *fitting) if name in fitting))


def _runs(runs: pd.DataFrame, x: str, y: str) -> pd.DataFrame:
    """A point per run: ``x``, ``y``, ``group``, and ``low`` and ``high`` of y where its standard error is known."""
    of_errors, at = y.replace("gap_", "gap_se_"), column(runs, y)
    error = column(runs, of_errors) if of_errors != y and of_errors in runs else np.nan
    low, high = at - NORMAL * error, at + NORMAL * error
    return pd.DataFrame({"x": column(runs, x), "y": at, "group": runs["group"], "low": low, "high": high})


def _cells(runs: pd.DataFrame, x: str, y: str) -> pd.DataFrame:
    """A point per combination of settings, as :func:`_runs`; the interval is that of :func:`segar.analysis.runs.summarise`."""
    by = [*settings_varied(runs), "group"]
    found = summarise(runs, (x, y), by)
    middle = select(found, figure=y)
    at = column(select(found, figure=x), "estimate")
    return pick(middle.assign(x=at, y=middle["estimate"]), ["x", "y", "group", "low", "high"])


def _draw(axes: Axes, points: pd.DataFrame) -> None:
    is_ordered = pd.api.types.is_any_real_numeric_dtype(points["group"])
    names = sorted(set(points["group"])) if is_ordered else style.ordered(points["group"])
    colours = dict(zip(names, style.SEQUENCE, strict=False)) if is_ordered else style.colours(names)
    for name, marker in zip(names, style.MARKERS, strict=False):
        part = select(points, group=name)
        look = {"fmt": "none", "ecolor": colours[name], "alpha": 0.35, "elinewidth": 1, "zorder": 2}
        axes.errorbar(column(part, "x"), column(part, "y"), yerr=error_bars(part, "y"), **look)
        look = {"marker": marker, "color": colours[name], "label": f"{name:g}" if is_ordered else entry(name), **DOT}
        axes.scatter(column(part, "x"), column(part, "y"), s=36, zorder=3, **look)
    zero_line(axes)


def _counts(runs: pd.DataFrame, points: pd.DataFrame, left_out: int, cells: bool) -> str:
    """What the points and their bars are, of how many runs and level sets."""
    level_sets = len(set(training_sets(runs)))
    of_runs = f"{counted(len(runs), 'run')} on {counted(level_sets, 'level set')}"
    kind = f"{len(points)} means of {of_runs}" if cells else of_runs
    if np.isfinite(column(points, "low")).any():
        kind += f"; bars: 95 % intervals over {'level sets' if cells else 'the episodes of a run'}"
    return f"{kind}; {left_out} without these figures left out" if left_out else kind


def _of_means(points: pd.DataFrame) -> str:
    """The correlation of the means that are drawn, without an interval: each stands for runs that share level sets."""
    found = correlate(column(points, "x"), column(points, "y")).pearson
    value = f"{found.estimate:+.2f}" if np.isfinite(found.estimate) else f"not available: {found.note}"
    return f"r of the {len(points)} means = {value}"


def _in_words(found: Estimate) -> str:
    if not np.isfinite(found.estimate):
        return f"not available: {found.note}"
    if not np.isfinite(found.low):
        return f"{found.estimate:+.2f} ({found.note})"
    return f"{found.estimate:+.2f}, 95 % [{found.low:+.2f}, {found.high:+.2f}] over level sets"


def draw(
    *runs: str,
    output: str = "gap.png",
    x: str = "w2",
    y: str = "gap",
    group: str | None = None,
    sweep: str | None = None,
    cells: bool = False,
) -> None:
    """The command line: draws the runs below these folders, and prints the file and the correlations.

    Args:
        output, x, y, group, cells: of :func:`gap_plot`.
        sweep: only the runs with this ``tracking.sweep``.
    """
    figure = gap_plot(read_runs(*runs, sweep=sweep), x, y, group, output, cells)
    print(figure.axes[0].get_title(loc="left"))
    print(Path(output).expanduser().resolve())


def main() -> None:
    """The command, with what the command line states."""
    run_from_command_line(draw)


if __name__ == "__main__":
    main()
