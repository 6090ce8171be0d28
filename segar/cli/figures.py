"""Figures that commands draw. The only file of segar that knows matplotlib, which it loads when a figure is asked for."""

import textwrap
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from segar.errors import PriorError, SegarError, did_you_mean
from segar.language import BaseShape
from segar.levels import LevelDistribution
from segar.noise import Empirical, Noise
from segar.playground import Varying, together, varying
from segar.support import need, replacing

FORMATS = (".png", ".pdf", ".svg")
COLUMNS = 4  # panels side by side
PANEL = 2.6  # [inch]
WIDTH = 40  # characters of a panel's title
POINTS = 400  # of a density's curve
DRAWS = 20_000  # that show a distribution without distribution function
BINS = 40
OUTLINES = 5  # of a random shape
PLANE_CELLS = 80  # along each side of the arena, so that the ends of the location priors lie on their edges
TAIL = 1e-4  # probability at either end that is not worth showing
BLUE, ORANGE = "#3b6ea5", "#d1702b"


def draw_marginals(distribution: LevelDistribution, path: str, title: str) -> None:
    """Draw every marginal of the distribution that is not constant, entities of equal distributions together, into a file:
    numbers and types of entities, then factors and world parameters.

    Raises:
        SegarError: matplotlib is not installed, the format is not known, nothing varies, or the file cannot be written.
    """
    panels = varying(distribution)
    if not panels:
        raise SegarError(f"every factor of '{title}' is constant: there is nothing to draw")
    columns = min(COLUMNS, len(panels))
    lines = -(-len(panels) // columns)
    figure = _new_figure(path, PANEL * columns, PANEL * lines + 0.4)
    axes = figure.subplots(lines, columns, squeeze=False).ravel()
    for axis, panel in zip(axes, panels, strict=False):
        _draw(axis, panel)
        axis.set_title(f"{panel.title}\n{textwrap.fill(together(panel.entities), WIDTH)}", fontsize=8)
        axis.tick_params(labelsize=7)
    for axis in axes[len(panels) :]:
        axis.set_axis_off()
    figure.suptitle(f"{title}: marginals that are not constant", fontsize=10)
    _save(figure, path)


def draw_grades(means: Sequence[Mapping[str, Any]], path: str) -> None:
    """Draw the mean scores of baselines in labs against the budget, with their intervals, into a file.

    Args:
        means: one for each ``baseline`` and ``budget``, with ``score``, ``low`` and ``high``.

    Raises:
        SegarError: as :func:`draw_marginals`.
    """
    figure = _new_figure(path, 2.8 * PANEL, 1.6 * PANEL)
    axis, budgets = figure.subplots(), sorted({row["budget"] for row in means})
    for k, name in enumerate(dict.fromkeys(row["baseline"] for row in means)):
        own = [row for row in means if row["baseline"] == name]
        score, low, high = (np.array([row[column] for row in own]) for column in ("score", "low", "high"))
        at = np.array([row["budget"] for row in own]) * 1.03**k  # beside each other
        style = {"linestyle": "--" if "passive" in name else "-", "marker": "o", "markersize": 3, "capsize": 2}
        axis.errorbar(at, score, np.nan_to_num([score - low, high - score]), label=name, **style)
    axis.set_xscale("log")
    axis.set_xticks(budgets, map(str, budgets))
    axis.set_xticks([], minor=True)
    axis.set_xlabel("budget [steps]")
    axis.set_ylabel("score, mean of hidden worlds, 95 %")
    axis.set_ylim(-0.05, 1.05)
    axis.legend(fontsize=7, frameon=False, loc="center left", bbox_to_anchor=(1, 0.5))
    _save(figure, path)


def _new_figure(path: str, width: float, height: float) -> Any:
    """A figure that :func:`_save` can write to the path."""
    suffix = Path(path).suffix
    if suffix.lower() not in FORMATS:
        raise SegarError(f"a figure is png, pdf or svg, not '{path}'.{did_you_mean(suffix, FORMATS)}")
    need("a figure", "matplotlib")
    from matplotlib.figure import Figure  # not pyplot: no window, no global state

    return Figure(figsize=(width, height), layout="constrained")


def _save(figure: Any, path: str) -> None:
    with replacing(Path(path), "the figure") as beside:
        figure.savefig(beside, format=Path(path).suffix[1:].lower(), dpi=150)


def _draw(axis: Any, one: Varying) -> None:
    unit = f"[{one.unit}]" if one.unit else ""
    if not isinstance(one.law, Noise):
        _draw_shape(axis, one.law, unit)
    elif not one.law.width:
        choice: Any = one.law
        _draw_names(axis, [key if isinstance(key, str) else repr(key) for key in choice.keys], choice.p)
    else:
        (_draw_plane if one.law.width == 2 else _draw_line)(axis, one.law, unit)


def _draw_names(axis: Any, names: Sequence[str], masses: Sequence[float]) -> None:
    """Probabilities of things that are not numbers."""
    for place, (name, mass) in enumerate(zip(names, masses, strict=True)):
        axis.barh(place, mass, color=ORANGE, height=0.3)
        axis.text(0.01 * max(masses), place - 0.2, name, fontsize=7)  # inside: long names leave the panel its width
    axis.set_yticks([])
    axis.set_xlim(0, 1.05 * max(masses))
    axis.set_ylim(len(names) - 0.5, -0.7)
    axis.set_xlabel("probability", fontsize=7, color=ORANGE)


def _draw_shape(axis: Any, shape: BaseShape, unit: str) -> None:
    """Some outlines of a random shape."""
    for hull in shape.sample(np.random.default_rng(0), OUTLINES):
        axis.plot(*np.concatenate([hull, hull[:1]]).T, color=BLUE, linewidth=0.8)
    axis.set_aspect("equal")
    axis.set_xlabel(f"{shape!r} {unit}", fontsize=7)


def _draw_line(axis: Any, law: Noise, unit: str) -> None:
    """Density as a curve, atoms as stems on an axis of their own; a histogram where there is no distribution function."""
    axis.set_xlabel(unit, fontsize=7)
    if isinstance(law, Empirical) and len(law.atoms[0]) > BINS:
        axis.hist(law.values, BINS, density=True, color=BLUE)
        return
    try:
        low, high = law.icdf(np.array([TAIL, 1 - TAIL]))
    except PriorError:  # a user's distribution need not have a distribution function
        axis.hist(np.asarray(law.sample(np.random.default_rng(0), DRAWS)), BINS, density=True, color=BLUE)
        return
    margin = 0.05 * (high - low) or 0.5
    x = np.linspace(low - margin, high + margin, POINTS)
    density, (values, masses) = np.asarray(law.pdf(x)), law.atoms
    values, masses = values[masses > TAIL], masses[masses > TAIL]
    if density.any():
        axis.fill_between(x, density, color=BLUE, alpha=0.3, linewidth=0)
        axis.plot(x, density, color=BLUE, linewidth=1)
        axis.set_ylim(bottom=0)
        axis.set_ylabel("density", fontsize=7, color=BLUE)
    elif np.array_equal(values, np.rint(values)):
        axis.xaxis.get_major_locator().set_params(integer=True)
    if len(values):
        stems = axis.twinx() if density.any() else axis
        stems.vlines(values, 0, masses, color=ORANGE, linewidth=2)
        stems.plot(values, masses, "o", color=ORANGE, markersize=3)
        stems.set_ylim(0, 1.05 * masses.max())
        stems.tick_params(labelsize=7)
        stems.set_ylabel("mass", fontsize=7, color=ORANGE)


def _draw_plane(axis: Any, law: Noise, unit: str) -> None:
    """How much mass lies where in the arena, seen from above; of draws, where there is no distribution function."""
    lines = np.linspace(-1.0, 1.0, PLANE_CELLS + 1)
    try:
        below = np.asarray(law.cdf(np.stack(np.meshgrid(lines, lines, indexing="ij"), axis=-1)))
        mass = np.diff(np.diff(below, axis=0), axis=1)
    except PriorError:
        mass = np.histogram2d(*np.asarray(law.sample(np.random.default_rng(0), DRAWS)).T, bins=[lines, lines])[0]
    axis.pcolormesh(lines, lines, np.maximum(mass.T, 0.0), cmap="Blues", vmin=0.0, rasterized=True)
    axis.set_aspect("equal")
    axis.set_xlabel(unit, fontsize=7)
