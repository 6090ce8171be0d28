"""A renderer that says plainly what a frame is: masks over all pixels, one thing after the other."""

from collections.abc import Callable

import numpy as np

from segar.language import CIRCLE, Floor, GlobalFriction, Mobile, Order, Position, Size, Visible
from tests.segar.observations.scenes import Scene

Look = Callable[[int, int, int], np.ndarray]
"""From an entity and the row and column of its place to a colour, or a picture as large as the frame."""


def draw_plainly(scene: Scene, level: int, look: Look, floor: np.ndarray, walls: float = 1.0) -> np.ndarray:
    """The frame of a level, uint8 ``[resolution, resolution, 3]``, on a floor of that size."""
    frame = floor.copy()
    resolution = len(frame)
    scale = resolution / (2 * walls)
    values, layout = scene.values[level], scene.layout
    read = {f: lambda e, f=f: values[e, layout.columns[f]] for f in layout.factors}
    things = [e for e in range(len(values)) if layout.types[scene.types[level, e]] is not GlobalFriction]
    things = sorted((e for e in things if read[Visible](e) > 0), key=lambda e: read[Order](e))
    is_tile = {e: Floor in layout.types[scene.types[level, e]].declared for e in things}
    for e in [e for e in reversed(things) if is_tile[e]] + [e for e in things if not is_tile[e]]:
        x, y = values[e, layout.columns[Position] :][:2]
        column, row = np.rint((x + walls) * scale), resolution - np.rint((y + walls) * scale)
        if scene.shape_kind[level, e] == CIRCLE:
            filled, inner = disc(resolution, row, column, np.rint(read[Size](e) / 2 * scale))
        else:
            corners = scene.vertices[level, e, : scene.vertex_count[level, e]]
            filled, inner = hull(resolution, corners, x, y, walls)
        colours = np.broadcast_to(look(e, int(row), int(column)), frame.shape)
        if is_tile[e] or read[Mobile](e) > 0:
            frame[filled] = 0
            frame[inner] = colours[inner]
        else:
            frame[filled] = colours[filled]
    return frame


def disc(resolution: int, row: float, column: float, radius: float) -> tuple[np.ndarray, np.ndarray]:
    """The pixels of a disc, and those of them whose four neighbours belong to it."""
    rows, columns = np.mgrid[:resolution, :resolution]

    def within(rows: np.ndarray, columns: np.ndarray) -> np.ndarray:
        return (columns - column) ** 2 + (rows - row) ** 2 <= radius * (radius + 1)

    filled = within(rows, columns)
    inner = filled.copy()
    for dy, dx in ((0, 1), (0, -1), (1, 0), (-1, 0)):
        inner &= within(rows + dy, columns + dx)
    return filled, inner


def hull(resolution: int, corners: np.ndarray, x: float, y: float, walls: float) -> tuple[np.ndarray, np.ndarray]:
    """The pixels whose place lies in a convex polygon, and those of them that lie a pixel or more inside."""
    rows, columns = np.mgrid[:resolution, :resolution]
    scale = resolution / (2 * walls)
    edges = np.roll(corners, -1, axis=0) - corners
    wx, wy = columns / scale - walls - x, (resolution - rows) / scale - walls - y
    depth = np.min(
        [
            (ex * (wy - ay) - ey * (wx - ax)) / np.sqrt(ex * ex + ey * ey)
            for (ax, ay), (ex, ey) in zip(corners, edges, strict=True)
        ],
        axis=0,
    )
    return depth >= 0, depth * scale >= 1
