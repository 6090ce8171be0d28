"""``segar gallery``: a contact sheet of tasks, difficulties and renderers, or what the signs of pictures mean."""

import argparse
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from os import PathLike
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np

from segar import language
from segar.cli.arguments import add_number, add_output, at_least, command, print_answer
from segar.envs import VectorEnv
from segar.errors import SegarError
from segar.levels import DIFFICULTIES, TASKS, Levels, family
from segar.observations import Pixels, TexturedPixels
from segar.rendering import Stage, View
from segar.support import need, need_pygame, replacing
from segar.textures import shipped_sets

PEOPLE, COLOURS = "for people", "solid colours"
TILE = 128  # [px] side of one picture
GAP, GROUP_GAP = 4, 14  # [px] between pictures, and between groups of them
MOST_COLOURS = 256  # of a file that lists its colours
RESOLUTION = 64  # of observations, which are shown enlarged
PAPER, INK = (250, 250, 250), (20, 20, 22)
TASK_ROW = ("puttputt", "billiards", "invisiball")  # in one row: each has one distribution
# What the contact sheet shows of the textures that come with SEGAR: one set of each kind.
TEXTURES = {"one": "auto-encoder", "baseline": "filters"}


Renderer: TypeAlias = View | Pixels | TexturedPixels
"""What draws a level: a view for people, or an observation of pixels."""


@dataclass(frozen=True)
class Cell:
    """One picture of a sheet: a level, and how it is drawn."""

    levels: Levels
    renderer: Renderer


def contact_sheet(seed: int = 0, renderers: Mapping[str, Renderer] | None = None) -> np.ndarray:
    """All tasks and difficulties, each in all ways: uint8 ``(height, width, 3)``.

    Args:
        seed: of the levels, one of each family.
        renderers: title to :class:`View` or observation; by default :func:`default_renderers`.
    """
    ways = default_renderers() if renderers is None else renderers
    names = [[f"{task}-{difficulty}" for difficulty in DIFFICULTIES] for task in TASKS] + [list(TASK_ROW)]
    rows = [
        [[Cell(family(name).sample(1, seed), way) for way in ways.values()] for name in row_names]
        for row_names in names
    ]
    return sheet(rows, [[[name] for name in row_names] for row_names in names], [list(ways) for _ in DIFFICULTIES])


def default_renderers() -> dict[str, Renderer]:
    """For people, in solid colours, and in one set of each kind of textures that comes with SEGAR."""
    found: dict[str, Renderer] = {PEOPLE: people(TILE), COLOURS: Pixels(RESOLUTION)}
    shipped = shipped_sets()
    return found | {title: TexturedPixels(name, RESOLUTION) for name, title in TEXTURES.items() if name in shipped}


def people(size: int) -> View:
    """The view of a small picture: no text."""
    return View(size=size, labels=False, line=False)


def draw_level(levels: Levels, renderer: Renderer, size: int = TILE) -> np.ndarray:
    """The first level as it is at the start, uint8 ``(size, size, 3)``.

    Raises:
        SegarError: the renderer is neither a :class:`View` nor an observation of square RGB frames that fit the size.
    """
    if isinstance(renderer, View):
        need_pygame("drawing for people")
    env = VectorEnv(levels, 1, observation=renderer if not isinstance(renderer, View) else "state", seed=0)
    observations, _ = env.reset(options={"levels": np.zeros(1, np.int64)})
    if isinstance(renderer, View):
        from segar.rendering.painter import Painter

        stage = Stage(levels, env.simulator.world, env.task, renderer.colours)
        frame = Painter(renderer).frame(stage.scene(env.state().state.values[0], 0))
    else:
        frame = np.asarray(observations[0])
    if frame.ndim != 3 or frame.shape[2] != 3 or frame.shape[0] != frame.shape[1] or size % frame.shape[0]:
        raise SegarError(
            f"a picture of {size} pixels shows square RGB frames that fit into it, not shape {frame.shape}"
        )
    return frame.repeat(size // frame.shape[0], axis=0).repeat(size // frame.shape[0], axis=1)


def sheet(
    rows: Sequence[Sequence[Sequence[Cell]]],
    names: Sequence[Sequence[Sequence[str]]],
    titles: Sequence[Sequence[str]],
    tile: int = TILE,
) -> np.ndarray:
    """Pictures in rows of groups, uint8 ``(height, width, 3)``.

    Args:
        rows: cells by row, group and place.
        names: what stands above each group of each row, or above each cell where there are as many as cells.
        titles: what stands above each place of the groups, in the first row.
        tile: side of a picture [px].
    """
    need_pygame("writing on sheets")
    import pygame

    from segar.rendering.painter import array_of

    pygame.font.init()
    small, large = pygame.font.Font(None, 16), pygame.font.Font(None, 18)
    line = large.get_height() + 8
    widest = [max(len(row[g]) for row in rows if g < len(row)) for g in range(max(map(len, rows)))]
    lefts = np.cumsum([GROUP_GAP, *(w * (tile + GAP) - GAP + GROUP_GAP for w in widest)])
    head = line if any(titles) else 0
    picture = pygame.Surface((int(lefts[-1]), head + len(rows) * (line + tile + GAP) + GROUP_GAP))
    picture.fill(PAPER)
    for g, group in enumerate(titles):
        for k, title in enumerate(group):
            _write(picture, small, title, int(lefts[g]) + k * (tile + GAP), 4, tile)
    for r, row in enumerate(rows):
        top = head + r * (line + tile + GAP)
        for g, cells in enumerate(row):
            for k, name in enumerate(names[r][g]):
                room = tile if len(names[r][g]) > 1 else len(cells) * (tile + GAP)
                _write(picture, large, name, int(lefts[g]) + k * (tile + GAP), top + 6, room)
            for k, cell in enumerate(cells):
                drawn = pygame.surfarray.make_surface(draw_level(cell.levels, cell.renderer, tile).swapaxes(0, 1))
                picture.blit(drawn, (int(lefts[g]) + k * (tile + GAP), top + line))
    return array_of(picture)


def save_png(picture: np.ndarray, path: str | PathLike[str], colours: int | None = None) -> None:
    """Write a picture, uint8 ``(height, width, 3)``; an existing file is replaced only by a complete one.

    Args:
        colours: how many the file may have, to make it smaller (2 to 256); None for all.

    Raises:
        SegarError: the path does not end in .png, it cannot have so many colours, Pillow is not installed, or the file
            cannot be written.
    """
    path = Path(path)
    _check_file(path, colours)
    from PIL import Image

    image = Image.fromarray(picture)
    if colours is not None:
        image = image.quantize(colours, dither=Image.Dither.NONE)
    with replacing(path, "the picture") as beside:
        image.save(beside, optimize=True)


def _check_file(path: Path, colours: int | None) -> None:
    if path.suffix.lower() != ".png":
        raise SegarError(f"a sheet is a .png, not '{path.name}'; name it '{path.stem}.png'")
    if colours is not None and not 2 <= colours <= MOST_COLOURS:
        raise SegarError(f"a file of few colours has 2 to {MOST_COLOURS} of them, not {colours}")
    need("writing pictures", "PIL")


def _write(picture: Any, font: Any, text: str, left: int, top: int, room: int) -> None:
    """A line of text, made narrower where it has no room."""
    import pygame

    drawn = font.render(text, True, INK)
    if drawn.get_width() > room:
        drawn = pygame.transform.smoothscale(drawn, (room, drawn.get_height()))
    picture.blit(drawn, (left, top))


THINGS: tuple[language.Entity, ...] = (
    language.GolfBall({language.Position: (-0.6, 0.6), language.Velocity: (3.0, -1.0)}),
    language.GoalTile({language.Position: (0.7, 0.7), language.Heat: 0.4}),
    language.Ball({language.Position: (-0.2, 0.6), language.Alive: False}),
    language.Ball({language.Position: (0.2, 0.6), language.Visible: False}),
    language.Charger({language.Position: (-0.6, 0.1), language.Charge: -0.2}),
    language.Charger({language.Position: (-0.1, 0.1), language.Charge: 1.5, language.Magnetism: 0.5}),
    language.Magnet({language.Position: (0.4, 0.1), language.Magnetism: 1.0}),
    language.Bumper({language.Position: (-0.6, -0.4)}),
    language.Damper({language.Position: (-0.1, -0.4), language.StoredEnergy: -1.0}),
    language.Object({language.Position: (0.4, -0.35), language.Mobile: False, language.Done: True}),
    language.SandTile({language.Position: (0.6, -0.6), language.Shape: language.Triangle(0.7), language.Friction: 0.9}),
    language.MagmaTile({language.Position: (0.75, 0.15), language.Shape: language.Square(0.35)}),
    language.FireTile({language.Position: (-0.5, -0.8), language.Shape: language.Circle(0.35)}),
    language.Hole({language.Position: (0.1, -0.8), language.Shape: language.Hexagon(0.4)}),
    language.Tile({language.Position: (-0.2, 0.9), language.Shape: language.Square(0.15)}),
)


def legend(size: int = 768) -> np.ndarray:
    """A level in which everything has a sign, uint8 ``View(size).shape``."""
    env = VectorEnv(Levels.from_entities([THINGS]), 1, render_mode="rgb_array", view=View(size=size), seed=0)
    env.reset()
    frames = env.render()
    assert frames is not None
    return frames[0]


def add_commands(commands: Any) -> None:
    """Add ``gallery`` to the sub-commands of a parser."""
    made = command(commands, "gallery", gallery, "draw a contact sheet of all tasks, difficulties and renderers")
    add_output(made, "the picture (png) to be written", required=True)
    add_number(made, "--seed", "of the levels", least=0, default=0)
    made.add_argument("--signs", action="store_true", help="draw one level with all signs that pictures have instead")
    made.add_argument("--colours", type=at_least(2), help="at most so many, up to 256, for a smaller file")


def gallery(chosen: argparse.Namespace) -> None:
    """``segar gallery``."""
    _check_file(Path(chosen.output), chosen.colours)  # before all is drawn
    picture = legend() if chosen.signs else contact_sheet(chosen.seed)
    save_png(picture, chosen.output, chosen.colours)
    height, width, _ = picture.shape
    answer = {"file": chosen.output, "width": width, "height": height}
    print_answer(chosen, answer, f"{chosen.output}: {width} x {height} pixels")
