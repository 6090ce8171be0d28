"""Scenes -> pictures for people, drawn with pygame at twice the size and then halved, so that edges are smooth."""

from functools import lru_cache
from typing import TypeAlias

import numpy as np
import pygame

from segar.language import GoalTile
from segar.rendering import marks
from segar.rendering.labels import Box, Request, place_labels
from segar.rendering.scene import Figure, Scene, View, charge_sources, electric_field, hint_strength
from segar.rendering.signs import SIGNS

RGB: TypeAlias = tuple[int, int, int]

OVERSAMPLING = 2
FLOOR, GRID, WALL = (58, 60, 66), (66, 68, 75), (150, 152, 160)
GRID_STEP = 0.25  # [m]
MARGIN = 0.018  # share of the size that is wall
LINE_BACKGROUND, TEXT = (24, 25, 28), (236, 238, 242)
BLACK, WHITE, GREY = (0, 0, 0), (255, 255, 255), SIGNS["dead"]["grey"]
AGENT, SPEED = SIGNS["agent"]["colour"], (255, 225, 60)
CHARGE_HINT, MAGNET_HINT = (170, 215, 255), (255, 190, 240)
FEWEST_HINTS, MOST_HINTS, HINT_ROOM = 8, 22, 16  # arrows across the arena, and pixels for each
SECONDS = 0.12  # an arrow is as long as the way of so much time
LONGEST_ARROW = 0.7  # [m]
SLOWEST = 0.02  # [m/s] that has an arrow


class Painter:
    """Draws scenes as a :class:`View` asks for them."""

    def __init__(self, view: View) -> None:
        pygame.font.init()
        self.view = view
        self._big = pygame.Surface((OVERSAMPLING * view.size,) * 2)
        self._unit = OVERSAMPLING * view.size / 512  # [px] lengths below are those of a picture of 512 pixels
        self._font = pygame.font.Font(None, max(round(view.size / 30), 11))
        self._line_font = pygame.font.Font(None, max(round(0.62 * view.line_height), 13))

    def draw(self, scene: Scene) -> pygame.Surface:
        """The picture, ``view.shape`` in size."""
        view, big = self.view, self._big
        self._scale = OVERSAMPLING * view.size * (1 - 2 * MARGIN) / (2 * scene.walls)
        self._draw_floor(scene)
        for figure in scene.figures:
            if figure.is_tile:
                self._draw_tile(figure)
        if view.fields:
            self._draw_fields(scene)
        objects = [figure for figure in scene.figures if not figure.is_tile]
        for figure in objects:
            self._draw_object(figure)
        for figure in objects:
            self._draw_velocity(figure)
        height, width, _ = view.shape
        picture = pygame.Surface((width, height))
        pygame.transform.smoothscale(big, (view.size, view.size), picture.subsurface((0, 0, view.size, view.size)))
        if view.labels and view.is_readable:
            self._write_labels(scene, picture)
        if view.line_height:
            self._write_line(scene.line, picture)
        return picture

    def frame(self, scene: Scene) -> np.ndarray:
        """The picture as an array, uint8 ``view.shape``."""
        return array_of(self.draw(scene))

    def pixel(self, place: np.ndarray, walls: float) -> tuple[float, float]:
        """Where in the picture a place of the arena is [px]."""
        inner = self.view.size * (1 - 2 * MARGIN) / (2 * walls)
        edge = self.view.size * MARGIN
        return edge + (float(place[0]) + walls) * inner, edge + (walls - float(place[1])) * inner

    def place(self, pixel: tuple[float, float], walls: float) -> np.ndarray:
        """Which place of the arena is at a pixel [m]; float64 ``(2,)``."""
        inner = self.view.size * (1 - 2 * MARGIN) / (2 * walls)
        edge = self.view.size * MARGIN
        return np.array([(pixel[0] - edge) / inner - walls, walls - (pixel[1] - edge) / inner])

    def _at(self, place: np.ndarray) -> tuple[float, float]:
        """Where on the oversampled picture a place is."""
        x, y = self.pixel(place, self._walls)
        return OVERSAMPLING * x, OVERSAMPLING * y

    def _width(self, pixels: float) -> int:
        """A width of a line, at least one pixel: pygame takes no width for no outline."""
        return max(round(pixels * self._unit), 1)

    def _draw_floor(self, scene: Scene) -> None:
        self._walls = scene.walls
        self._big.fill(WALL)
        edge, side = OVERSAMPLING * self.view.size * MARGIN, 2 * scene.walls * self._scale
        self._big.fill(FLOOR, pygame.Rect(edge, edge, side + 1, side + 1))
        lines = np.arange(-np.floor(scene.walls / GRID_STEP), np.floor(scene.walls / GRID_STEP) + 1) * GRID_STEP
        for x in lines:
            for a, b in (((x, -scene.walls), (x, scene.walls)), ((-scene.walls, x), (scene.walls, x))):
                pygame.draw.line(self._big, GRID, self._at(np.array(a)), self._at(np.array(b)), OVERSAMPLING)

    def _outline(self, figure: Figure, scale: float = 1.0) -> list[tuple[float, float]]:
        if len(figure.corners):
            return [self._at(figure.place + scale * (corner - figure.place)) for corner in figure.corners]
        return marks.circle_outline(self._at(figure.place), scale * figure.radius * self._scale)

    def _draw_tile(self, figure: Figure) -> None:
        unit = self._unit
        if not figure.is_visible:
            marks.dashed(self._big, self._outline(figure), 1.2 * unit, GREY)
            return
        pygame.draw.polygon(self._big, figure.colour, self._outline(figure))
        if figure.is_hole:
            for share, grey in SIGNS["hole_steps"]:
                pygame.draw.polygon(self._big, 3 * [grey], self._outline(figure, share))
        self._draw_ground(figure)
        if issubclass(figure.entity, GoalTile):
            for share in SIGNS["goal_rings"]:
                pygame.draw.polygon(self._big, WHITE, self._outline(figure, share), self._width(2.5))
            pygame.draw.circle(self._big, WHITE, self._at(figure.place), SIGNS["goal_dot"] * unit)
        pygame.draw.polygon(self._big, BLACK, self._outline(figure), self._width(1.5))

    def _draw_ground(self, figure: Figure) -> None:
        """Dots, the denser the rougher the ground; waves, the denser the hotter it is."""
        if figure.friction <= 0 and figure.heat <= 0:
            return
        outline, unit = self._outline(figure), self._unit
        box = pygame.Rect(*_bounds(outline)).clip(self._big.get_rect())
        if not box.width or not box.height:
            return
        pattern = pygame.Surface(box.size, pygame.SRCALPHA)
        ink = (0, 0, 0, 120) if sum(figure.colour) > 300 else (255, 255, 255, 90)
        if figure.friction > 0:
            dots = SIGNS["dots"]
            spacing = (dots["widest"] - dots["closer"] * min(figure.friction, 1)) * unit
            marks.dots(pattern, spacing, dots["size"] * unit, ink)
        if figure.heat > 0:
            hot = (255, 240, 90, 190) if figure.colour[1] < 120 else (150, 0, 0, 190)
            waves = SIGNS["waves"]
            spacing = (waves["widest"] - waves["closer"] * min(figure.heat, 1)) * unit
            marks.waves(pattern, spacing, waves["width"] * unit, hot)
        inside = pygame.Surface(box.size, pygame.SRCALPHA)
        pygame.draw.polygon(inside, (255, 255, 255, 255), [(x - box.left, y - box.top) for x, y in outline])
        pattern.blit(inside, (0, 0), special_flags=pygame.BLEND_RGBA_MULT)
        self._big.blit(pattern, box)

    def _draw_fields(self, scene: Scene) -> None:
        layer = pygame.Surface(self._big.get_size(), pygame.SRCALPHA)
        sources = charge_sources(scene.figures) if scene.has_charges else []
        if sources:
            hints = min(max(self.view.size // HINT_ROOM, FEWEST_HINTS), MOST_HINTS)
            step = 2 * scene.walls / hints
            line = (np.arange(hints) + 0.5) * step - scene.walls
            points = np.stack(np.meshgrid(line, line), axis=-1).reshape(-1, 2)
            field = electric_field(sources, points)
            length = np.sqrt((field**2).sum(axis=1, keepdims=True))
            ahead = field / np.where(length > 0, length, 1.0) * 0.36 * step
            for point, way, strength in zip(points, ahead, hint_strength(field), strict=True):
                ink = (*CHARGE_HINT, round(25 + 130 * strength))
                if strength > 0:
                    marks.arrow(layer, self._at(point - way), self._at(point + way), 1.6 * self._unit, ink)
        for figure in scene.figures if scene.has_magnets else ():
            if figure.magnetism != 0 and figure.is_alive and not figure.is_done:
                for k in range(1, 4):
                    radius = (figure.radius + 0.07 * k) * self._scale
                    ink = (*MAGNET_HINT, round((150 - 40 * k) * min(0.4 + abs(figure.magnetism), 1)))
                    marks.swirl(layer, self._at(figure.place), radius, 1.6 * self._unit, figure.magnetism > 0, ink)
        self._big.blit(layer, (0, 0))

    def _draw_object(self, figure: Figure) -> None:
        unit, centre, radius = self._unit, self._at(figure.place), figure.radius * self._scale
        outline = self._outline(figure)
        if figure.is_done:
            marks.dashed(self._big, outline, 1.5 * unit, GREY)
            return
        if figure.is_alive and figure.energy:
            size = _chevron_size(figure.energy) * unit
            ink = SIGNS["chevrons"]["push" if figure.energy > 0 else "brake"]
            marks.chevrons(self._big, centre, radius + 2 * unit, size, figure.energy > 0, ink)
        if figure.is_visible:
            pygame.draw.polygon(self._big, figure.colour if figure.is_alive else GREY, outline)
            pygame.draw.polygon(self._big, BLACK, outline, self._width(2.5 if figure.is_mobile else 1))
            if not figure.is_mobile:
                bolts = SIGNS["bolts"]
                marks.bolts(self._big, centre, radius - bolts["inside"] * unit, bolts["size"] * unit, BLACK)
        else:
            self._draw_unseen(figure, outline)
        if figure.is_agent:
            outside, width = SIGNS["agent"]["outside"] * unit, self._width(SIGNS["agent"]["width"])
            pygame.draw.polygon(self._big, AGENT, self._outline(figure, 1 + outside / radius), width)
        if figure.is_alive:
            self._draw_signs(figure, centre, radius)
        else:
            dead = SIGNS["dead"]
            marks.cross(self._big, centre, dead["side"] * radius, dead["width"] * unit, dead["colour"])

    def _draw_unseen(self, figure: Figure, outline: list[tuple[float, float]]) -> None:
        ghost = pygame.Surface(self._big.get_size(), pygame.SRCALPHA)
        pygame.draw.polygon(ghost, (*figure.colour, 70), outline)
        self._big.blit(ghost, (0, 0))
        marks.dashed(self._big, outline, 2 * self._unit, WHITE)

    def _draw_signs(self, figure: Figure, centre: tuple[float, float], radius: float) -> None:
        """Sign of charge and magnetism, side by side if there are both."""
        ink = BLACK if sum(figure.colour) > 330 and figure.is_visible else WHITE
        both = bool(figure.charge and figure.magnetism)
        sign = SIGNS["sign"]
        size = radius * sign["beside" if both else "alone"]
        for value, mark, side in ((figure.charge, marks.charge_sign, -1), (figure.magnetism, marks.magnet_sign, 1)):
            if value:
                strength = sign["weakest"] + (1 - sign["weakest"]) * min(abs(value), 1.0)
                at = (centre[0] + (side * sign["apart"] * radius if both else 0), centre[1])
                mark(self._big, at, size * strength, value > 0, ink)

    def _draw_velocity(self, figure: Figure) -> None:
        if _has_arrow(figure):
            ends = self._at(figure.place), self._at(self._arrow_end(figure))
            marks.arrow(self._big, *ends, 3.2 * self._unit, SPEED, border=1.2 * self._unit)

    def _arrow_end(self, figure: Figure) -> np.ndarray:
        speed = max(float(np.hypot(*figure.velocity)), SLOWEST)
        return figure.place + figure.velocity / speed * min(SECONDS * speed, LONGEST_ARROW)

    def _write_labels(self, scene: Scene, picture: pygame.Surface) -> None:
        """Names and factors, those of the agent and of objects before those of the ground."""
        figures = sorted(scene.figures, key=lambda f: (not f.is_agent, f.is_tile))
        texts = [_with_outline(self._font, _words(f), AGENT if f.is_agent else TEXT) for f in figures]
        requests = [
            Request(self._reach(figure), *text.get_size(), inside=_has_room(figure, self._box(figure), text))
            for figure, text in zip(figures, texts, strict=True)
        ]
        objects = [figure for figure in figures if not figure.is_tile]
        hidden = [box for figure in objects for box in (self._box(figure, 0.85), *self._arrow_boxes(figure))]
        frame: Box = (2.0, 2.0, self.view.size - 2.0, self.view.size - 2.0)
        for text, box in zip(texts, place_labels(requests, hidden, frame), strict=True):
            picture.blit(text, (round(box[0]), round(box[1])))

    def _box(self, figure: Figure, scale: float = 1.0) -> Box:
        """The box around a figure [px of the picture]."""
        outline = np.array(self._outline(figure, scale)) / OVERSAMPLING
        (left, top), (right, bottom) = outline.min(axis=0), outline.max(axis=0)
        return float(left), float(top), float(right), float(bottom)

    def _reach(self, figure: Figure) -> Box:
        """The box around a figure and its signs."""
        more = 1 + (_chevron_size(figure.energy) + 2 if figure.energy else 3 if figure.is_agent else 0)
        left, top, right, bottom = self._box(figure)
        more *= self._unit / OVERSAMPLING
        return left - more, top - more, right + more, bottom + more

    def _arrow_boxes(self, figure: Figure) -> list[Box]:
        """Boxes along the arrow of a figure's velocity, outside of it."""
        end, size = self._arrow_end(figure), 5 * self._unit / OVERSAMPLING
        points = [np.array(self._at(figure.place + k / 4 * (end - figure.place))) / OVERSAMPLING for k in (2, 3, 4)]
        return [(x - size, y - size, x + size, y + size) for x, y in points] if _has_arrow(figure) else []

    def _write_line(self, line: str, picture: pygame.Surface) -> None:
        height = self.view.line_height
        picture.fill(LINE_BACKGROUND, (0, self.view.size, self.view.size, height))
        text = self._line_font.render(line, True, TEXT)
        room = self.view.size - 12
        if text.get_width() > room:
            text = pygame.transform.smoothscale(text, (room, round(text.get_height() * room / text.get_width())))
        picture.blit(text, (6, self.view.size + (height - text.get_height()) // 2))


def array_of(surface: pygame.Surface) -> np.ndarray:
    """The colours of a surface, uint8 ``(height, width, 3)``, contiguous."""
    return np.ascontiguousarray(pygame.surfarray.array3d(surface).swapaxes(0, 1))


def _has_arrow(figure: Figure) -> bool:
    return figure.is_alive and not figure.is_done and float(np.hypot(*figure.velocity)) >= SLOWEST


def _chevron_size(energy: float) -> float:
    """Of the chevrons of stored energy [px of a picture of 512]."""
    size = SIGNS["chevrons"]
    return min(size["least"] + size["more"] * abs(energy), size["most"])


def _has_room(figure: Figure, box: Box, text: pygame.Surface) -> bool:
    """Whether a text can stand on the figure, hiding no sign of it."""
    is_plain = not figure.charge and not figure.magnetism and figure.is_alive and not figure.is_agent
    fits = text.get_width() < 0.9 * (box[2] - box[0]) and text.get_height() < 0.6 * (box[3] - box[1])
    return is_plain and fits and not issubclass(figure.entity, GoalTile)


def _words(figure: Figure) -> str:
    state = "  (done)" if figure.is_done else "  (dead)" if not figure.is_alive else ""
    state += "" if figure.is_visible or figure.is_done else "  (invisible)"
    return f"{figure.name}  {figure.note}".strip() + state


def _bounds(points: list[tuple[float, float]]) -> tuple[int, int, int, int]:
    """Left, top, width and height of the smallest whole box around points."""
    low, high = np.floor(np.min(points, axis=0)).astype(int), np.ceil(np.max(points, axis=0)).astype(int)
    return int(low[0]), int(low[1]), int(high[0] - low[0]) + 1, int(high[1] - low[1]) + 1


@lru_cache(maxsize=512)
def _with_outline(font: pygame.font.Font, text: str, colour: RGB) -> pygame.Surface:
    """Text with a dark edge, readable on any ground."""
    dark, light = font.render(text, True, (16, 16, 18)), font.render(text, True, colour)
    made = pygame.Surface((light.get_width() + 2, light.get_height() + 2), pygame.SRCALPHA)
    for dx in (0, 1, 2):
        for dy in (0, 1, 2):
            made.blit(dark, (dx, dy))
    made.blit(light, (1, 1))
    return made
