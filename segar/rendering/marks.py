"""Signs that say what a thing is like: arrows, charges, chevrons, patterns. Coordinates and lengths are in pixels."""

import math
from collections.abc import Sequence
from itertools import pairwise
from typing import TypeAlias

import pygame

from segar.rendering.signs import SIGNS

Point: TypeAlias = tuple[float, float]
Colour: TypeAlias = tuple[int, ...]

BLACK, WHITE = (0, 0, 0), (255, 255, 255)
HEAD = 0.6  # half-width of an arrow's head as a share of its length
DASHES = 18  # around an outline


def arrow(surface: pygame.Surface, start: Point, end: Point, width: float, colour: Colour, border: float = 0) -> None:
    """An arrow with a dark border of so many pixels."""
    length = math.dist(start, end)
    if length < 1e-6:
        return
    along = ((end[0] - start[0]) / length, (end[1] - start[1]) / length)
    head = min(3.5 * width, length)

    def at(forward: float, aside: float) -> Point:
        return start[0] + forward * along[0] - aside * along[1], start[1] + forward * along[1] + aside * along[0]

    for grow, paint in ((border, BLACK), (0.0, colour)) if border else ((0.0, colour),):
        neck, half, wide = length - head - grow, width / 2 + grow, HEAD * head + 1.6 * grow
        outline = [at(-grow, half), at(neck, half), at(neck, wide), at(length + 1.6 * grow, 0)]
        outline += [at(neck, -wide), at(neck, -half), at(-grow, -half)]
        pygame.draw.polygon(surface, paint, outline)


def charge_sign(surface: pygame.Surface, centre: Point, size: float, is_positive: bool, colour: Colour) -> None:
    """A plus or a minus."""
    x, y = centre
    thick = max(size / 4, 1.0)
    bar(surface, (x - size / 2, y), (x + size / 2, y), thick, colour)
    if is_positive:
        bar(surface, (x, y - size / 2), (x, y + size / 2), thick, colour)


def magnet_sign(surface: pygame.Surface, centre: Point, size: float, is_positive: bool, colour: Colour) -> None:
    """A field that comes out of the picture (a dot in a circle) or goes into it (a cross in a circle)."""
    thick = max(round(size / 8), 1)
    pygame.draw.circle(surface, colour, centre, size / 2, thick)
    if is_positive:
        pygame.draw.circle(surface, colour, centre, size / 6)
    else:
        cross(surface, centre, 0.55 * size, thick, colour)


def cross(surface: pygame.Surface, centre: Point, size: float, width: float, colour: Colour) -> None:
    """Two diagonals of a square of this side."""
    (x, y), half = centre, size / 2
    bar(surface, (x - half, y - half), (x + half, y + half), width, colour)
    bar(surface, (x - half, y + half), (x + half, y - half), width, colour)


def bar(surface: pygame.Surface, start: Point, end: Point, width: float, colour: Colour) -> None:
    """A thick line with square ends, of any direction."""
    length = max(math.dist(start, end), 1e-6)
    aside = (-(end[1] - start[1]) / length * width / 2, (end[0] - start[0]) / length * width / 2)
    corners = [(p[0] + s * aside[0], p[1] + s * aside[1]) for p, s in ((start, 1), (end, 1), (end, -1), (start, -1))]
    pygame.draw.polygon(surface, colour, corners)


def chevrons(surface: pygame.Surface, centre: Point, radius: float, size: float, outward: bool, colour: Colour) -> None:
    """Arrow heads around a circle: outward from what pushes, inward to what brakes."""
    tip, foot = (radius + size, radius) if outward else (radius, radius + size)
    count = SIGNS["chevrons"]["count"]
    for k in range(count):
        angle = 2 * math.pi * (k + 0.5) / count
        wide = 0.9 * size / (radius + size)
        points = [on_circle(centre, tip, angle), *(on_circle(centre, foot, angle + s * wide) for s in (1, -1))]
        pygame.draw.polygon(surface, colour, points)


def bolts(surface: pygame.Surface, centre: Point, radius: float, size: float, colour: Colour) -> None:
    """Dots on a circle: what is fixed to the floor."""
    count = SIGNS["bolts"]["count"]
    for k in range(count):
        pygame.draw.circle(surface, colour, on_circle(centre, radius, 2 * math.pi * (k + 0.5) / count), size)


def swirl(
    surface: pygame.Surface, centre: Point, radius: float, width: float, turns_left: bool, colour: Colour
) -> None:
    """Three bent arrows around a point, counter-clockwise or clockwise as people see them."""
    turn = -1 if turns_left else 1  # pixels count downwards
    for k in range(3):
        first = 2 * math.pi * k / 3
        arc = [on_circle(centre, radius, first + turn * 1.5 * i / 12) for i in range(13)]
        pygame.draw.lines(surface, colour, False, arc, max(round(width), 1))
        ahead = on_circle(centre, radius, first + turn * (1.5 + 4.5 * width / radius))
        inner, outer = (on_circle(centre, radius + s * 2.2 * width, first + turn * 1.5) for s in (-1, 1))
        pygame.draw.polygon(surface, colour, [ahead, inner, outer])


def dashed(surface: pygame.Surface, outline: Sequence[Point], width: float, colour: Colour) -> None:
    """A closed outline in dashes: what the agent does not see."""
    sides = [(a, b, math.dist(a, b)) for a, b in pairwise([*outline, outline[0]])]
    dash = sum(length for _, _, length in sides) / (2 * DASHES)
    walked = 0.0
    for a, b, length in sides:
        done = 0.0
        while done < length - 1e-9:
            dashes = math.floor((walked + done) / dash + 1e-9)
            there = min((dashes + 1) * dash - walked, length)
            if dashes % 2 == 0:
                bar(surface, _between(a, b, done / length), _between(a, b, there / length), width, colour)
            done = there
        walked += length


def on_circle(centre: Point, radius: float, angle: float) -> Point:
    return centre[0] + radius * math.cos(angle), centre[1] + radius * math.sin(angle)


def circle_outline(centre: Point, radius: float) -> list[Point]:
    """A circle as a polygon of short sides."""
    return [on_circle(centre, radius, 2 * math.pi * k / 72) for k in range(72)]


def dots(surface: pygame.Surface, spacing: float, size: float, colour: Colour) -> None:
    """Rows of dots all over a surface, every second row shifted: rough ground."""
    width, height = surface.get_size()
    for row in range(int(height / (0.87 * spacing)) + 2):
        for column in range(-1, int(width / spacing) + 2):
            at = ((column + 0.5 * (row % 2)) * spacing, row * 0.87 * spacing)
            pygame.draw.circle(surface, colour, at, size)


def waves(surface: pygame.Surface, spacing: float, width: float, colour: Colour) -> None:
    """Wavy lines all over a surface: hot ground."""
    across, down = surface.get_size()
    step, height = spacing / 6, spacing / 5
    for row in range(int(down / spacing) + 2):
        line = [
            (k * step, (row + 0.5) * spacing + height * math.sin(2 * math.pi * k / 9))
            for k in range(int(across / step) + 2)
        ]
        pygame.draw.lines(surface, colour, False, line, max(round(width), 1))


def _between(a: Point, b: Point, share: float) -> Point:
    return a[0] + share * (b[0] - a[0]), a[1] + share * (b[1] - a[1])
