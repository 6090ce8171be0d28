"""``python -m analysis.renderings``: the paper's pictures of tasks and of visual features, drawn anew from levels and textures.

Figure 2c shows two tasks. The appendix shows one state in the features of the linear auto-encoder and in those of the
filters of a network's first layer, and one state in the features of auto-encoders that were trained from different seeds.
"""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from analysis.plotting import style
from experiments.commands.command_line import run_from_command_line
from experiments.runs.files import replacing
from segar.language import (
    Ball,
    Bumper,
    Charge,
    Charger,
    Damper,
    Entity,
    FireTile,
    GoalTile,
    GolfBall,
    Heat,
    Hexagon,
    Hole,
    MagmaTile,
    Magnet,
    Magnetism,
    Mobile,
    Order,
    Position,
    SandTile,
    Shape,
    Square,
    Triangle,
)
from segar.levels import Levels, family
from segar.observations import Pixels, TexturedPixels
from segar.textures import TextureSet

RESOLUTION = 128  # pixels per frame: patterns repeat after a few pixels, and should be seen
ZOOM = 4  # each pixel becomes so many in a row
MARGIN, TITLE_HEIGHT = 16, 44  # [px]
DPI = 100

Panel = tuple[str, np.ndarray]


def run(output: Path = Path("renderings")) -> None:
    """Draws all pictures as PNG files into the folder ``output``."""
    output.mkdir(parents=True, exist_ok=True)
    for name, panels in {"tasks": tasks(), "features": features(), "feature_variants": variants()}.items():
        path = output / f"{name}.png"
        save(side_by_side(panels), path)
        print(path)


def tasks() -> list[Panel]:
    """Figure 2c: two tasks in solid colours."""
    billiards = family("billiards").sample(1, seed=0)
    return [
        ("PuttPutt", first_frame(course(), Pixels(RESOLUTION))),
        ("Billiards", first_frame(billiards, Pixels(RESOLUTION))),
    ]


def features() -> list[Panel]:
    """One state in two kinds of visual features (appendix)."""
    titles = {"one": "linear auto-encoder", "baseline": "clustered filters"}
    return [(title, first_frame(course(), TexturedPixels(name, RESOLUTION))) for name, title in titles.items()]


def variants(textures: str = "five", count: int = 3) -> list[Panel]:
    """One state in the features of auto-encoders trained from different seeds (appendix)."""
    models = TextureSet.load(textures)
    seeds = models.origin["seeds"]
    return [
        (f"linear auto-encoder, seed {seeds[k]}", first_frame(course(), TexturedPixels(models[k], RESOLUTION)))
        for k in range(count)
    ]


def course() -> Levels:
    """A level of PuttPutt with something of everything."""
    things: Sequence[Entity] = (
        GolfBall({Position: (-0.75, -0.7)}),
        GoalTile({Position: (0.72, 0.68)}),
        SandTile({Position: (-0.45, 0.5), Shape: Hexagon(0.75), Order: 3}),
        MagmaTile({Position: (0.5, -0.55), Shape: Square(0.6), Order: 4}),
        FireTile({Position: (-0.1, -0.55), Shape: Triangle(0.6), Heat: 0.5, Order: 5}),
        Hole({Position: (0.1, 0.72), Shape: Hexagon(0.3)}),
        Charger({Position: (-0.6, -0.1), Charge: -1.0}),
        Ball({Position: (0.15, 0.1)}),
        Magnet({Position: (0.7, 0.1), Magnetism: -1.0}),
        Bumper({Position: (-0.3, 0.5), Mobile: True}),
        Damper({Position: (0.45, -0.1)}),
    )
    return Levels.from_entities([things])


def first_frame(levels: Levels, observation: Any) -> np.ndarray:
    """What the observation shows of the first level at its start, uint8 ``[rows, columns, 3]``."""
    bound, first, everywhere = observation.bind(levels, 1), np.zeros(1, np.int64), np.ones(1, np.bool_)
    if hasattr(bound, "start"):
        bound.start(np.zeros(1, np.uint64), first, everywhere)
    bound.begin(levels.values[:1].copy(), first, everywhere)
    frame = np.empty((1, *bound.space.shape), np.uint8)
    bound.write(levels.values[:1], first, frame, first)
    return frame[0]


def side_by_side(panels: Sequence[Panel]) -> Figure:
    """Frames beside each other under their titles; every pixel of a frame is a square of whole pixels."""
    frames = [frame.repeat(ZOOM, axis=0).repeat(ZOOM, axis=1) for _, frame in panels]
    side = len(frames[0])
    width, height = MARGIN + len(frames) * (side + MARGIN), side + TITLE_HEIGHT + MARGIN
    with style.applied():
        figure = Figure(figsize=(width / DPI, height / DPI), dpi=DPI)
        FigureCanvasAgg(figure)
        for k, (frame, (title, _)) in enumerate(zip(frames, panels, strict=True)):
            left = MARGIN + k * (side + MARGIN)
            figure.figimage(frame, left, MARGIN, origin="upper")
            middle = (MARGIN + side + TITLE_HEIGHT / 2) / height
            figure.text((left + side / 2) / width, middle, title, ha="center", va="center", fontsize=14)
    return figure


def save(figure: Figure, path: Path) -> None:
    """Write a figure as PNG, pixel by pixel; an existing file is replaced only by a complete one."""
    with replacing(path) as temporary:
        figure.savefig(temporary, format="png", dpi=DPI, metadata={"Software": None})


if __name__ == "__main__":
    run_from_command_line(run)
