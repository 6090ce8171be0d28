"""``python -m analysis.played_plot``: how far the levels that runs played were from the target, against frames.

Runs with a curriculum or endless levels log it; see :mod:`experiments.curricula.played_log`. Runs that differ in nothing but
their seeds are one line, their mean.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from analysis.plotting import style
from analysis.plotting.figures import new_figure, save_figure
from experiments.commands.hydra_app import run_simple_command
from experiments.runs.run_folder import METRICS, read_config, read_metrics, root_folder, run_folders
from experiments.settings import RunConfig, RunFolderError

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


def curves_of(runs: Sequence[tuple[RunConfig, Path]]) -> dict[str, Points]:
    """The logged figures of runs, by what tells the runs apart but for their seeds."""
    names = [name_of(config) for config, _ in runs]
    found: dict[str, dict[str, list[tuple[int, float]]]] = {}
    wanted = {*PANELS, *(floor for _, floor in PANELS.values() if floor)}
    for name, (_, folder) in zip(names, runs, strict=True):
        points = found.setdefault(name, {figure: [] for figure in wanted})
        for row in read_metrics(folder).to_pylist():
            group, _, figure = row["name"].partition("/")
            if group == "played" and figure in wanted:
                points[figure].append((row["frames"], row["value"]))
    return dict(found)


def name_of(config: RunConfig) -> str:
    """What a legend calls the runs that differ from this one in their seeds alone."""
    curriculum = "uniform" if config.curriculum is None else config.curriculum.name
    return f"{config.levels.train}, {config.levels.count} levels, {config.algorithm.name}, {curriculum}"


def played_figure(curves: Mapping[str, Points]) -> Figure:
    """A panel for each of :data:`PANELS`: its figure against frames, and dashed what independent levels of the target have."""
    figure = new_figure(4.2 * len(PANELS), 3.2 + 0.13 * len(curves))
    axes = figure.subplots(1, len(PANELS))
    for ax, (name, (label, floor)) in zip(axes, PANELS.items(), strict=True):
        for k, points in enumerate(curves.values()):
            ax.plot(*mean_curve(points[name]), color=f"C{k}", marker=".", label=list(curves)[k])
        values = [value for points in curves.values() for _, value in points.get(floor or "", ())]
        if values:
            ax.axhline(float(np.median(values)), color="0.4", linestyle="--", label="independent levels of the target")
        ax.set_xlabel("frames")
        ax.set_ylabel(label)
    lines, names = axes[0].get_legend_handles_labels()
    figure.legend(lines, names, loc="outside lower center", ncols=2, frameon=False)
    return figure


def mean_curve(points: Sequence[tuple[int, float]]) -> tuple[np.ndarray, np.ndarray]:
    """Frames in ascending order, and the mean of the values at each."""
    frames, values = np.array([frame for frame, _ in points]), np.array([value for _, value in points])
    at = np.unique(frames)
    return at, np.array([values[frames == one].mean() for one in at])


if __name__ == "__main__":
    run_simple_command(played_plot, PlayedPlotConfig, __doc__)
