"""``python -m segar.analysis.renderings``: the paper's pictures of tasks and visual features, from levels and textures.

Figure 2c shows two tasks. The appendix shows one state in the features of the linear auto-encoder and in those of the
filters of a network's first layer, and one state in the features of auto-encoders that were trained from different seeds.
"""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure

import segar
from segar.analysis.plotting import style
from segar.analysis.plotting.figures import METADATA, new_figure
from segar.experiments.commands.command_line import run_from_command_line
from segar.experiments.runs.files import replacing
from segar.language import Heat, Hexagon, Order, Square, Triangle
from segar.observations import Pixels, TexturedPixels
from segar.textures import TextureSet

RESOLUTION = 128  # pixels per frame: patterns repeat after a few pixels, and should be seen
SIDE = 5.4  # [in] of a frame

Panel = tuple[str, np.ndarray]


def run(output: Path = Path("renderings")) -> None:
    """Draws all pictures as PNG files into the folder ``output``."""
    for name, panels in {"tasks": tasks(), "features": features(), "feature_variants": variants()}.items():
        with replacing(output / f"{name}.png") as temporary:
            side_by_side(panels).savefig(temporary, format="png", metadata=METADATA[".png"])
        print(output / f"{name}.png")


def tasks() -> list[Panel]:
    """Figure 2c: two tasks in solid colours."""
    levels = {"PuttPutt": course(), "Billiards": segar.family("billiards").sample(1, seed=0)}
    return [(title, first_frame(one, Pixels(RESOLUTION))) for title, one in levels.items()]


def features() -> list[Panel]:
    """One state in two kinds of visual features (appendix)."""
    titles = {"one": "linear auto-encoder", "baseline": "clustered filters"}
    return [(title, first_frame(course(), TexturedPixels(name, RESOLUTION))) for name, title in titles.items()]


def variants() -> list[Panel]:
    """One state in the features of three auto-encoders trained from different seeds (appendix)."""
    models = TextureSet.load("five")
    titles = [f"linear auto-encoder, seed {seed}" for seed in models.origin["seeds"][:3]]
    return [(title, first_frame(course(), TexturedPixels(models[k], RESOLUTION))) for k, title in enumerate(titles)]


def course() -> segar.Levels:
    """A level of PuttPutt with something of everything."""
    things: Sequence[segar.Entity] = (
        segar.GolfBall({segar.Position: (-0.75, -0.7)}),
        segar.GoalTile({segar.Position: (0.72, 0.68)}),
        segar.SandTile({segar.Position: (-0.45, 0.5), segar.Shape: Hexagon(0.75), Order: 3}),
        segar.MagmaTile({segar.Position: (0.5, -0.55), segar.Shape: Square(0.6), Order: 4}),
        segar.FireTile({segar.Position: (-0.1, -0.55), segar.Shape: Triangle(0.6), Heat: 0.5, Order: 5}),
        segar.Hole({segar.Position: (0.1, 0.72), segar.Shape: Hexagon(0.3)}),
        segar.Charger({segar.Position: (-0.6, -0.1), segar.Charge: -1.0}),
        segar.Ball({segar.Position: (0.15, 0.1)}),
        segar.Magnet({segar.Position: (0.7, 0.1), segar.Magnetism: -1.0}),
        segar.Bumper({segar.Position: (-0.3, 0.5), segar.Mobile: True}),
        segar.Damper({segar.Position: (0.45, -0.1)}),
    )
    return segar.Levels.from_entities([things])


def first_frame(levels: segar.Levels, observation: Any) -> np.ndarray:
    """What the observation shows of the first level at its start, uint8 ``[rows, columns, 3]``."""
    bound, first, everywhere = observation.bind(levels, 1), np.zeros(1, np.int64), np.ones(1, np.bool_)
    if hasattr(bound, "start"):
        bound.start(np.zeros(1, np.uint64), first, everywhere)
    bound.begin(levels.values[:1].copy(), first, everywhere)
    frame = np.empty((1, *bound.space.shape), np.uint8)
    bound.write(levels.values[:1], first, frame, first)
    return frame[0]


def side_by_side(panels: Sequence[Panel]) -> Figure:
    """Frames beside each other under their titles."""
    with style.applied():
        figure = new_figure(SIDE * len(panels), SIDE + 0.3)
        for axes, (title, frame) in zip(figure.subplots(1, len(panels)), panels, strict=True):
            axes.imshow(frame, interpolation="nearest")
            axes.set_title(title, fontsize=14)
            axes.set_axis_off()
    return figure


if __name__ == "__main__":
    run_from_command_line(run)
