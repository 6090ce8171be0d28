"""``python -m analysis.played_plot``: how far the levels that runs played were from the target, against frames.

Runs with a curriculum or endless levels log it; see :mod:`experiments.curricula.played_log`. Runs that differ in nothing but
their seeds are one line, their mean.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import EngFormatter

from analysis.plotting import style
from analysis.plotting.figures import new_figure, save_figure
from analysis.runs import SEEDS
from experiments.commands.hydra_app import run_simple_command
from experiments.runs.run_folder import METRICS, read_config, read_metrics, root_folder, run_folders
from experiments.settings import RunConfig, RunFolderError, flat

PANELS = {  # figures of the log, what their axes say, and the figure that the dashed line shows
    "w2_target": ("W2 to the target", "w2_floor"),
    "ks": ("largest KS of a factor", "ks_floor"),
    "effective_number": ("effective number", None),
}


@dataclass(frozen=True)
class PlayedPlotConfig:
    """Which runs, and where the figure goes."""

    root: str | None = None  # the folder that holds the run folders; None: runs/ of the checkout
    out: str = "played"  # the figure: out.pdf and out.png


def played_plot(config: PlayedPlotConfig) -> None:
    """Draws the figure; raises :class:`RunFolderError` where no run logged what it played."""
    root = root_folder(config.root)
    runs = [(read_config(folder), folder) for folder in run_folders(root) if (folder / METRICS).exists()]
    curves = {name: points for name, points in curves_of(runs).items() if points["w2_target"]}
    if not curves:
        raise RunFolderError(
            f"no run in {root} logged which levels it played; runs with levels.count=endless or with a curriculum do"
        )
    with style.applied():
        figure = played_figure(curves)
    for path in save_figure(figure, Path(config.out).expanduser().resolve()):
        print(path)


Points = Mapping[str, list[tuple[int, float]]]  # by the name of a figure: frames and values
Curve = tuple[str, str]  # which levels are the target, and how was trained


def curves_of(runs: Sequence[tuple[RunConfig, Path]]) -> dict[Curve, Points]:
    """The logged figures of runs, by what tells the runs apart but for their seeds."""
    names = names_of([config for config, _ in runs])
    found: dict[Curve, dict[str, list[tuple[int, float]]]] = {}
    wanted = {*PANELS, *(floor for _, floor in PANELS.values() if floor)}
    for name, (_, folder) in zip(names, runs, strict=True):
        points = found.setdefault(name, {figure: [] for figure in wanted})
        for row in read_metrics(folder).to_pylist():
            group, _, figure = row["name"].partition("/")
            if group == "played" and figure in wanted:
                points[figure].append((row["frames"], row["value"]))
    return dict(found)


def names_of(configs: Sequence[RunConfig]) -> list[Curve]:
    """The target of each run, and what a legend calls those that differ from it in their seeds alone."""
    short = [_in_short(config) for config in configs]
    settings = [_settings(config) for config in configs]
    found = []
    for name, own in zip(short, settings, strict=True):
        alike = [other for other, of in zip(settings, short, strict=True) if of == name]
        differing = [key for key in own if any(other.get(key) != own[key] for other in alike)]
        found.append((name[0], ", ".join([name[1], *(f"{key}={own[key]}" for key in differing)])))
    return found


def _in_short(config: RunConfig) -> Curve:
    curriculum = "uniform" if config.curriculum is None else config.curriculum.name
    return f"{config.levels.train}, {config.levels.count} levels", f"{config.algorithm.name}, {curriculum}"


def _settings(config: RunConfig) -> dict[str, Any]:
    """All settings that decide results but the seeds, by their dotted names."""
    return {key: value for key, value in flat(config.identity()).items() if key not in (*SEEDS, "evaluation.seed")}


def played_figure(curves: Mapping[Curve, Points]) -> Figure:
    """A row for each target and a panel for each of :data:`PANELS`: its figure against frames, and dashed what independent
    levels of the target have."""
    targets, methods = (list(dict.fromkeys(names)) for names in zip(*curves, strict=True))
    colours = style.colours(methods)
    figure = new_figure(4.2 * len(PANELS), 2.7 * len(targets) + 0.4 + 0.13 * len(methods))
    rows = figure.subplots(len(targets), len(PANELS), squeeze=False, sharex=True)
    handles = {}
    for target, axes in zip(targets, rows, strict=True):
        of_target = {method: points for (name, method), points in curves.items() if name == target}
        axes[0].set_title(target, loc="left")
        for ax, (name, (label, floor)) in zip(axes, PANELS.items(), strict=True):
            for method, points in of_target.items():
                (handles[method],) = ax.plot(*mean_curve(points[name]), color=colours[method], marker=".")
            values = [value for points in of_target.values() for _, value in points.get(floor or "", ())]
            if values:
                line = ax.axhline(float(np.median(values)), color="0.4", linestyle="--")
                handles["independent levels of the target"] = line
            ax.xaxis.set_major_formatter(EngFormatter(sep=""))
            ax.set_ylabel(label)
    for ax in rows[-1]:
        ax.set_xlabel("frames")
    figure.legend(list(handles.values()), list(handles), loc="outside lower center", ncols=2, frameon=False)
    return figure


def mean_curve(points: Sequence[tuple[int, float]]) -> tuple[np.ndarray, np.ndarray]:
    """Frames in ascending order, and the mean of the values at each."""
    frames, values = np.array([frame for frame, _ in points]), np.array([value for _, value in points])
    at = np.unique(frames)
    return at, np.array([values[frames == one].mean() for one in at])


if __name__ == "__main__":
    run_simple_command(played_plot, PlayedPlotConfig, __doc__)
