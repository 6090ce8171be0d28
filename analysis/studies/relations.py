"""Pictures of the geometric relations for ``docs/reference/sizes-and-relations.md``, from what the engine says of each place.

``python -m analysis.studies.relations`` writes them. Every pixel is a place of a ball's centre: the compiled rules are asked
there whether the relation holds. A test compares the pictures of the page with what the engine says today.
"""

import dataclasses
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
from PIL import Image

import segar
from segar import Ball, Circle, Position, Shape, Tile
from segar.language import BaseShape, Label, Order, Square, contains

FOLDER = Path(__file__).resolve().parents[2] / "docs" / "images" / "relations"
PIXELS = 161  # of a side; odd, so that a centre is in the middle
REACH = 0.56  # [m] from the middle of a picture to its sides
BALL = 0.2  # [m] diameter
TILE = 0.6  # [m] diameter or side
# Colours where no relation, the first, the second holds.
NONE, FIRST, SECOND = (244, 244, 240), (120, 170, 220), (240, 180, 100)
OUTLINE, RIM = (20, 20, 20), (190, 30, 30)
LINE = 0.8 * 2 * REACH / (PIXELS - 1)  # [m] half the width of a line


class On(segar.Flag): ...


class Inside(segar.Flag): ...


class OnOther(segar.Flag): ...


class Marker(Ball):
    """A ball that notes which relations hold."""

    on: On
    inside: Inside
    on_other: OnOther


class Ground(Tile):
    label: Label = "ground"  # type: ignore[assignment]


class Other(Tile):
    label: Label = "other"  # type: ignore[assignment]


@segar.rule(relation=segar.is_on)
def note_on(ball: Marker, tile: Ground) -> segar.SetFactor[On]:
    return segar.SetFactor[On](ball[On], True)


@segar.rule(relation=contains)
def note_inside(ball: Marker, tile: Ground) -> segar.SetFactor[Inside]:
    return segar.SetFactor[Inside](ball[Inside], True)


@segar.rule(relation=segar.is_on)
def note_other(ball: Marker, tile: Other) -> segar.SetFactor[OnOther]:
    return segar.SetFactor[OnOther](ball[OnOther], True)


WORLD = segar.World(rules=[note_on, note_inside, note_other])


def stay(ball: Marker, action: segar.Action) -> segar.SetFactor[segar.Velocity]:
    return segar.SetFactor[segar.Velocity](ball[segar.Velocity], (0.0 * action[0], 0.0))


def ask(tile: BaseShape, places: np.ndarray, other: tuple[float, float] | None = None) -> Mapping[str, np.ndarray]:
    """What holds of a ball of diameter ``BALL`` at each of the places, float ``[n, 2]``: factor's name to bool ``[n]``.

    Args:
        tile: the outline of the ground, whose centre is the origin.
        other: the centre of a second, circular tile, which lies on top of the first.
    """
    things = [Marker({Shape: Circle(BALL)}), Ground({Shape: tile, Order: 1})]
    if other is not None:
        things.append(Other({Shape: Circle(TILE), Position: other, Order: 0}))
    one = segar.Levels.from_entities([things], world=WORLD)
    n, x = len(places), one.layout.columns[Position]
    levels = one[np.zeros(n, int)]
    values = levels.values.copy()
    values[:, 0, x : x + 2] = places
    levels = dataclasses.replace(levels, values=values)
    task = segar.Task("stay", stay, sub_steps=1)
    env = segar.envs.VectorEnv(levels, n, task=task, seed=0)
    env.reset(options={"levels": np.arange(n)})
    *_, info = env.step(np.zeros((n, 2), np.float32))
    return {f.__name__: info["factors"][f.__name__][:, 0] == 1 for f in (On, Inside, OnOther)}


def draw(tile: BaseShape, relations: Sequence[str], other: tuple[float, float] | None = None) -> np.ndarray:
    """A picture, uint8 ``[PIXELS, PIXELS, 3]``: places where the relations hold, the outlines of tiles, and of one tile the
    ball at the last place on the way to the right where the relation holds."""
    axis = np.linspace(-REACH, REACH, PIXELS)
    places = np.stack(np.meshgrid(axis, axis[::-1]), axis=-1).reshape(-1, 2)
    holds = ask(tile, places, other)
    picture = np.full((len(places), 3), NONE, np.uint8)
    for relation, colour in zip(relations, (FIRST, SECOND), strict=False):
        picture[holds[relation]] = colour
    picture[np.abs(_depth(tile, places)) < LINE] = OUTLINE
    if other is not None:
        picture[np.abs(np.hypot(*(places - other).T) - TILE / 2) < LINE] = OUTLINE
    if other is None:
        last = places[holds[relations[0]] & (places[:, 1] == 0), 0].max()
        distance = np.hypot(places[:, 0] - last, places[:, 1])
        picture[(np.abs(distance - BALL / 2) < LINE) | (distance < 3 * LINE)] = RIM
    return picture.reshape(PIXELS, PIXELS, 3)


def _depth(tile: BaseShape, places: np.ndarray) -> np.ndarray:
    """Distance of each place from the outline of a circle or an upright square, float ``[n]``, positive inside."""
    if tile.kind == Circle.kind:
        return tile.size / 2 - np.hypot(*places.T)
    return tile.size / 2 - np.abs(places).max(axis=1)


PICTURES = {
    "on-circle": lambda: draw(Circle(TILE), ["On"]),
    "on-square": lambda: draw(Square(TILE), ["On"]),
    "inside-circle": lambda: draw(Circle(TILE), ["Inside"]),
    "inside-square": lambda: draw(Square(TILE), ["Inside"]),
    "topmost": lambda: draw(Square(TILE), ["On", "OnOther"], other=(0.2, 0.2)),
}


def main(folder: Path = FOLDER) -> None:
    """Writes the pictures into ``folder``."""
    folder.mkdir(parents=True, exist_ok=True)
    for name, made in PICTURES.items():
        Image.fromarray(made()).quantize(16).save(folder / f"{name}.png", optimize=True)


if __name__ == "__main__":
    main()
