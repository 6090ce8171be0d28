"""Figures that commands draw. The only file of segar that knows matplotlib, which it loads when a figure is asked for."""

from __future__ import annotations

import importlib.util
import os
import uuid
from pathlib import Path
from typing import Any

import numpy as np

from segar.distribution import LevelDistribution
from segar.errors import PriorError, SegarError, did_you_mean
from segar.noise import Deterministic, Noise

FORMATS = (".png", ".pdf", ".svg")
COLUMNS = 4  # panels side by side
PANEL = 2.6  # [inch]
POINTS = 400  # of a density's curve
DRAWS = 20_000  # from a law on the plane, for its picture
BINS = 40
TAIL = 1e-4  # probability at either end that is not worth showing
BLUE, ORANGE = "#3b6ea5", "#d1702b"


def draw_marginals(distribution: LevelDistribution, path: str, title: str) -> None:
    """Draw every marginal of the distribution that is not constant, entities of equal laws together, into a file.

    Raises:
        SegarError: matplotlib is not installed, the format is not known, nothing varies, or the file cannot be written.
    """
    target = Path(path)
    if target.suffix.lower() not in FORMATS:
        raise SegarError(f"a figure is png, pdf or svg, not '{path}'.{did_you_mean(target.suffix, FORMATS)}")
    if importlib.util.find_spec("matplotlib") is None:
        raise SegarError("a figure needs matplotlib, which is not installed: pip install segar[analysis]")
    from matplotlib.figure import Figure  # not pyplot: no window, no global state

    panels = _panels(distribution)
    if not panels:
        raise SegarError(f"every factor of '{title}' is constant: there is nothing to draw")
    columns = min(COLUMNS, len(panels))
    lines = -(-len(panels) // columns)
    figure = Figure(figsize=(PANEL * columns, PANEL * lines + 0.4), layout="constrained")
    axes = figure.subplots(lines, columns, squeeze=False).ravel()
    for axis, ((factor, law), entities) in zip(axes, panels.items(), strict=False):
        _draw_plane(axis, law) if law.width == 2 else _draw_line(axis, law)
        axis.set_title(f"{factor}\n{', '.join(entities)}", fontsize=8)
        axis.tick_params(labelsize=7)
    for axis in axes[len(panels) :]:
        axis.set_axis_off()
    figure.suptitle(f"{title}: marginals that are not constant", fontsize=10)
    _save(figure, target)


def _panels(distribution: LevelDistribution) -> dict[tuple[str, Noise], list[str]]:
    """(factor, law) -> the entities that have it."""
    panels: dict[tuple[str, Noise], list[str]] = {}
    for entity, laws in distribution.marginals().items():
        for factor, law in laws.items():
            if not isinstance(law, Deterministic):
                panels.setdefault((factor.__name__, law), []).append(entity)
    return panels


def _draw_line(axis: Any, law: Noise) -> None:
    """Density as a curve, atoms as stems on an axis of their own; draws, of a law that says no more."""
    try:
        low, high = law.icdf(np.array([TAIL, 1 - TAIL]))
    except PriorError:  # a law of one's own need not say its distribution function
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
    if len(values):
        stems = axis.twinx() if density.any() else axis
        stems.vlines(values, 0, masses, color=ORANGE, linewidth=2)
        stems.plot(values, masses, "o", color=ORANGE, markersize=3)
        stems.set_ylim(0, 1.05 * masses.max())
        stems.tick_params(labelsize=7)
        stems.set_ylabel("mass", fontsize=7, color=ORANGE)
    if density.any():
        axis.set_ylabel("density", fontsize=7, color=BLUE)


def _draw_plane(axis: Any, law: Noise) -> None:
    """How often draws fall where, seen from above."""
    x, y = np.asarray(law.sample(np.random.default_rng(0), DRAWS)).T
    axis.hist2d(x, y, bins=BINS, range=[[-1, 1], [-1, 1]], cmap="Blues")
    axis.set_aspect("equal")


def _save(figure: Any, target: Path) -> None:
    """Write beside the target, then rename: nothing is half-written."""
    beside = target.with_name(f".{target.name}.{uuid.uuid4().hex[:12]}.tmp")
    try:
        figure.savefig(beside, format=target.suffix[1:].lower(), dpi=150)
        os.replace(beside, target)
    except OSError as said:
        beside.unlink(missing_ok=True)
        raise SegarError(f"the figure cannot be written to {target}: {said.strerror or said}") from said
