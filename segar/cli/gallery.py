"""``segar gallery``: a contact sheet of tasks, difficulties and renderers, or what the signs of pictures mean."""

import argparse
from collections.abc import Mapping
from os import PathLike
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np

from segar import language
from segar.cli.arguments import add_number, add_output, command, print_answer
from segar.envs import Env
from segar.levels import DIFFICULTIES, TASKS, Levels, family
from segar.observations import Pixels, TexturedPixels
from segar.rendering import View
from segar.support import need, need_pygame, replacing
from segar.textures import shipped_sets

TILE = 128  # [px] side of one picture
PEOPLE = View(size=TILE, labels=False, line=False)  # a small picture has no text
GAP, GROUP_GAP = 4, 14  # [px] between pictures, and between groups of them
RESOLUTION = 64  # of observations, which are shown enlarged
PAPER, INK = (250, 250, 250), (20, 20, 22)
TASK_ROW = ("puttputt", "billiards", "invisiball")  # in one row: each has one distribution
# What the contact sheet shows of the textures that come with SEGAR: one set of each kind.
TEXTURES = {"one": "auto-encoder", "baseline": "filters"}


Renderer: TypeAlias = View | Pixels | TexturedPixels
"""What draws a level: a view for people, or an observation of pixels."""


def contact_sheet(seed: int = 0, renderers: Mapping[str, Renderer] | None = None) -> np.ndarray:
    """All tasks and difficulties, each in all ways: uint8 ``(height, width, 3)``.

    Args:
        seed: of the levels, one of each family.
        renderers: title to :class:`View` or observation, drawn beside each other; by default :func:`default_renderers`.
    """
    need_pygame("writing on sheets")
    import pygame

    from segar.rendering.painter import array_of

    ways = default_renderers() if renderers is None else renderers
    rows = [[f"{task}-{difficulty}" for difficulty in DIFFICULTIES] for task in TASKS] + [list(TASK_ROW)]
    pygame.font.init()
    small, large = pygame.font.Font(None, 16), pygame.font.Font(None, 18)
    line, group = large.get_height() + 8, len(ways) * (TILE + GAP) - GAP
    lefts = [GROUP_GAP + g * (group + GROUP_GAP) for g in range(len(DIFFICULTIES))]
    picture = pygame.Surface((lefts[-1] + group + GROUP_GAP, line + len(rows) * (line + TILE + GAP) + GROUP_GAP))
    picture.fill(PAPER)
    for left in lefts:
        for k, title in enumerate(ways):
            _write(picture, small, title, left + k * (TILE + GAP), 4, TILE)
    for r, row in enumerate(rows):
        top = line + r * (line + TILE + GAP)
        for left, name in zip(lefts, row, strict=True):
            _write(picture, large, name, left, top + 6, group + GAP)
            levels = family(name).sample(1, seed)
            for k, way in enumerate(ways.values()):
                drawn = pygame.surfarray.make_surface(draw_level(levels, way).swapaxes(0, 1))
                picture.blit(drawn, (left + k * (TILE + GAP), top + line))
    return array_of(picture)


def default_renderers() -> dict[str, Renderer]:
    """For people, in solid colours, and in one set of each kind of textures that comes with SEGAR."""
    found: dict[str, Renderer] = {"for people": PEOPLE, "solid colours": Pixels(RESOLUTION)}
    shipped = shipped_sets()
    return found | {title: TexturedPixels(name, RESOLUTION) for name, title in TEXTURES.items() if name in shipped}


def draw_level(levels: Levels, renderer: Renderer) -> np.ndarray:
    """The first level as it is at the start, uint8 ``(TILE, TILE, 3)``; ``renderer``: of square frames that fit into it."""
    if isinstance(renderer, View):
        frame = _picture(levels, renderer)
    else:
        frame, _ = Env(levels, observation=renderer, seed=0).reset(options={"level": 0})
    return frame.repeat(TILE // len(frame), axis=0).repeat(TILE // len(frame), axis=1)


def _picture(levels: Levels, view: View) -> Any:
    """The first level for people, uint8 ``view.shape``."""
    env = Env(levels, render_mode="rgb_array", view=view, seed=0)
    env.reset(options={"level": 0})
    return env.render()


def save_png(picture: np.ndarray, path: str | PathLike[str]) -> None:
    """Write a picture, uint8 ``(height, width, 3)``; an existing file is replaced only by a complete one.

    Raises:
        SegarError: the file cannot be written.
    """
    from PIL import Image

    with replacing(Path(path), "the picture") as beside:
        Image.fromarray(picture).save(beside, "png", optimize=True)


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
    return _picture(Levels.from_entities([THINGS]), View(size=size))


def add_commands(commands: Any) -> None:
    """Add ``gallery`` to the sub-commands of a parser."""
    made = command(commands, "gallery", gallery, "draw a contact sheet of all tasks, difficulties and renderers")
    add_output(made, "the picture (png) to be written", required=True, endings=(".png",))
    add_number(made, "--seed", "of the levels", least=0, default=0)
    made.add_argument("--signs", action="store_true", help="draw one level with all signs that pictures have instead")


def gallery(chosen: argparse.Namespace) -> None:
    """``segar gallery``."""
    need("writing pictures", "PIL")  # before all is drawn
    picture = legend() if chosen.signs else contact_sheet(chosen.seed)
    save_png(picture, chosen.output)
    height, width, _ = picture.shape
    answer = {"file": chosen.output, "width": width, "height": height}
    print_answer(chosen, answer, f"{chosen.output}: {width} x {height} pixels")
