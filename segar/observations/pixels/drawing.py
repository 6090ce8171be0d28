"""Frames: how many pixels they have, which part of the world they show, where the bytes of a pixel lie, and how they are drawn.

Compiled kernels paint one static background per environment, copy it, and stamp what moves. World coordinates become pixels
as in 2022: ``px = rint((x + walls) scale)`` and ``py = resolution - rint((y + walls) scale)``. What a thing looks like is a
pattern that repeats: row r of it, ``texels[env, entity, plane, r]``, is so long that most spans of a disc are one copy out of
it. A solid colour is a pattern of one pixel. Every environment is drawn by itself, so a frame does not depend on its batch.
"""

import math
from typing import Any, Literal, NamedTuple

import gymnasium
import numpy as np

from segar import language
from segar.engine import Call, Given, Rows, Scratch, call_of
from segar.errors import SegarError, must_be
from segar.language import ARENA, CIRCLE, HULL, Entity, Factor, Layout, Mobile, Order, Position, Size, Visible
from segar.levels import Levels
from segar.observations.copying import KERNEL_OPTIONS, clear_bytes, copy_bytes
from segar.support import cached

Channels = Literal["first", "last"]
CHANNELS = ("first", "last")
LUMA = (299, 587, 114)  # thousandths of red, green and blue in grey (ITU-R BT.601)


class Canvas(NamedTuple):
    """What a kernel knows of a frame: ``uint8[planes, resolution, resolution, texel]``, rows from the top.

    A pixel of an RGB frame is three bytes side by side (one plane, texel 3), or one byte in each of three planes; that
    of a grey frame is one byte.
    """

    resolution: int
    walls: float
    """Distance of the frame's edges from the middle of the world [m]."""
    scale: float
    """Pixels per metre."""
    planes: int
    texel: int
    """Bytes of a pixel within a plane."""


def canvas_for(resolution: int, grey: bool, channels: Channels, levels: Levels) -> Canvas:
    """The canvas that shows the arena of these levels, from wall to wall."""
    walls = levels.world.walls if levels.world is not None else ARENA
    first = not grey and channels == "first"
    return Canvas(resolution, walls, resolution / (2 * walls), 3 if first else 1, 1 if grey or first else 3)


def frame_space(resolution: int, grey: bool, channels: Channels) -> gymnasium.spaces.Box:
    """The space of single frames, uint8: ``[resolution, resolution, 3]``, the 3 first or last, 1 where they are grey."""
    depth, side = (1 if grey else 3), (resolution, resolution)
    return gymnasium.spaces.Box(0, 255, (depth, *side) if channels == "first" else (*side, depth), np.uint8)


def check_frame(who: str, resolution: int, channels: str) -> None:
    """Refuse frames that are not whole 64-bit words, and unknown orders of channels; raises :class:`SegarError`."""
    if resolution not in range(32, 257, 4):
        raise SegarError(f"{who}: resolution must be a multiple of 4 from 32 to 256, not {resolution!r}")
    if channels not in CHANNELS:
        raise SegarError(f"{who}: channels {must_be(channels, CHANNELS)}")


def pixels_as_bytes(rgb: np.ndarray, canvas: Canvas) -> np.ndarray:
    """Pictures, uint8 ``[..., rows, columns, 3]``, as the bytes of frames, uint8 ``[..., planes, rows, columns * texel]``."""
    if canvas.planes == 3:
        return np.ascontiguousarray(np.moveaxis(rgb, -1, -3))
    if canvas.texel == 1:
        return grey_of(rgb)[..., None, :, :]
    return np.ascontiguousarray(rgb).reshape(*rgb.shape[:-3], 1, rgb.shape[-3], -1)


def grey_of(rgb: Any) -> np.ndarray:
    """Grey of colours, uint8 ``[...]`` of uint8 ``[..., 3]``: their luma, rounded."""
    return ((np.asarray(rgb, np.int64) @ np.array(LUMA) + 500) // 1000).astype(np.uint8)


RENDERER_VERSION = 2
"""Raised whenever the frame of some state changes; ``tests/segar/observations/test_golden_frames.py`` holds frames of it."""


class Drawing:
    """Frames of ``num_envs`` environments, of things with given patterns.

    Attributes:
        texels: uint8 ``[env, entity, plane, P, n * texel]``: rows of each thing's pattern, which has period P; from
            any of the first P pixels on, a row goes on for whole periods.
        floor: int64 ``[env]``, which of the floors lies in each environment.

    Args:
        floors: uint8 ``[floor, P, P, 3]``, patterns of the arena's floor.
    """

    def __init__(self, canvas: Canvas, levels: Levels, num_envs: int, floors: np.ndarray) -> None:
        period = floors.shape[1]
        length = period - 1 + period * -(-RUN // period)
        entities = levels.types.shape[1]
        self.texels = np.zeros((num_envs, entities, canvas.planes, period, length * canvas.texel), np.uint8)
        self.floor = np.zeros(num_envs, np.int64)
        at = np.arange(canvas.resolution) % period
        pictures = pixels_as_bytes(floors[:, at[:, None], at], canvas)
        self._floors = pictures.reshape(len(floors), -1)
        self._backgrounds = np.zeros((num_envs, self._floors.shape[1]), np.uint8)
        self._canvas, self._geometry = canvas, frame_geometry(levels, canvas.resolution)
        self._entities, self._width = entities, levels.layout.width

    def paint(self, values: np.ndarray, level: np.ndarray, rows: np.ndarray) -> None:
        """Paint floors and tiles of environments ``rows`` (int64)."""
        paint_backgrounds(
            values, level, rows, self._geometry, self._canvas, self.texels, self.floor, self._floors, self._backgrounds,
            np.empty(self._entities, np.int64),
        )  # fmt: skip

    def draw(self, values: np.ndarray, level: np.ndarray, out: np.ndarray, rows: np.ndarray) -> None:
        """Draw the frames of environments ``rows`` (int64) into ``out``, uint8 ``[env, ...]``, each contiguous."""
        stride = out.strides[0]
        if out.flags.c_contiguous:
            frames = out.reshape(-1)
        elif out[0].flags.c_contiguous and stride > 0:
            frames = np.lib.stride_tricks.as_strided(out, ((len(out) - 1) * stride + out[0].size,), (1,))
        else:
            raise SegarError(f"frames are drawn into contiguous memory only, not into strides of {out.strides} bytes")
        draw_frames(
            values, level, rows, self._geometry, self._canvas, self.texels, self._backgrounds, frames, stride,
            np.empty(self._entities, np.int64),
        )  # fmt: skip

    @property
    def states(self) -> tuple[Given, Given]:
        """The arguments ``values`` and ``level`` of calls."""
        return Given("float64", ("envs", self._entities, self._width)), Given("int64", ("envs",))

    def calls(self, when: str, in_rows: bool = False) -> list[Call]:
        """What :meth:`paint` does to ``begin`` and :meth:`draw` to ``write``, for other targets.

        ``frames`` is uint8, the frames of all environments one after the other.

        Args:
            in_rows: whether the things of a call are the rows of frames (``frame_rows``, from top to bottom, of one
                environment after the other), and not environments.
        """
        values, level = self.states
        rows, chosen = Rows("frame_rows") if in_rows else Rows(), Scratch(int, self._entities)
        common = [rows, self._geometry, self._canvas, self.texels]
        if when == "begin":
            arguments = [values, level, *common, self.floor, self._floors, self._backgrounds, chosen]
            name, function = ("paint_rows", paint_rows) if in_rows else ("paint_backgrounds", paint_backgrounds)
            return [call_of(name, function, arguments, SIZES)]
        frames, size = Given("uint8", ("bytes",)), self._floors.shape[1]
        arguments = [values, level, *common, self._backgrounds, frames, size, chosen]
        name, function = ("draw_rows", draw_rows) if in_rows else ("draw_frames", draw_frames)
        return [call_of(name, function, arguments, SIZES)] if when == "write" else []


SIZES: dict[str, tuple[str | None, ...]] = {
    **{f"geometry_{name}": ("levels", None) for name in ("types", "kinds", "vertex_counts")},
    **{f"geometry_{name}": ("levels", None, "corners", None) for name in ("vertices", "edges")},
    **{"texels": ("envs", None, None, None, None), "floor": ("envs",), "backgrounds": ("envs", None)},
    **{"types": ("levels", None), "blends": ("envs", None)},
}
"""Names of the sizes of what kernels of frames are called with."""

# Entries of ``FrameGeometry.columns[type]``: the column of each factor that the kernel reads; -1 where a type lacks it.
POSITION, SIZE, VISIBLE, ORDER, MOBILE = range(5)
DRAWN: tuple[type[Factor], ...] = (Position, Size, Visible, Order, Mobile)  # in that order
RUN = 8  # [pixels] a row of a pattern gives this many in one copy, from any pixel of its period on
LEVEL_EDGE = 1e-6  # an edge whose normal has a smaller x runs along rows, and no estimate finds its columns


class FrameGeometry(NamedTuple):
    """What the kernels know of a level set; the first five arrays lead with the level and the entity."""

    types: np.ndarray
    kinds: np.ndarray
    vertex_counts: np.ndarray
    vertices: np.ndarray
    edges: np.ndarray
    """float64 ``[level, entity, k, 4]``; see :func:`edge_lines`."""
    columns: np.ndarray
    """int64 ``[type, 5]``, in the order of ``POSITION`` and so on."""
    is_floor: np.ndarray
    """bool ``[type]``: tiles, which are painted once per episode."""
    spans: np.ndarray
    """int32; see :func:`disc_spans`."""


def frame_geometry(levels: Levels, resolution: int) -> FrameGeometry:
    """The geometry of a level set in frames of ``resolution`` pixels."""
    types = levels.layout.types
    columns = [[column_of(levels.layout, t, factor) for factor in DRAWN] for t in types]
    return FrameGeometry(
        levels.types,
        levels.shape_kind,
        levels.vertex_count,
        levels.vertices,
        edge_lines(levels.vertices, levels.vertex_count),
        np.array(columns, np.int64),
        np.array([language.Floor in t.declared for t in types]),
        disc_spans(resolution),
    )


def column_of(layout: Layout, entity: type[Entity], factor: type[Factor]) -> int:
    """The column in which an entity type holds a factor, -1 if it does not."""
    held = language.holds(entity, factor)
    return layout.columns[held] if held is not None else -1


def disc_spans(resolution: int) -> np.ndarray:
    """Half-widths of discs, int32 ``[radius, |dy|, 2]`` in pixels for radii 0 to ``resolution``.

    The disc of radius r holds the pixels with dx^2 + dy^2 <= r (r + 1), the midpoint circle's rule; its outline are
    those with one of the four neighbours outside. Entry 0 is the half-width of the disc in the row, entry 1 that of the
    disc without its outline; -1 where the row holds none.
    """
    spans = np.full((resolution + 1, resolution + 1, 2), -1, dtype=np.int32)
    for r in range(resolution + 1):
        dy = np.arange(r + 2)
        inside = r * (r + 1) - dy**2
        half = np.where(inside >= 0, np.sqrt(np.maximum(inside, 0)).astype(np.int32), -1)  # half[r + 1] is -1
        spans[r, : r + 1, 0] = half[:-1]
        spans[r, : r + 1, 1] = np.minimum(half[:-1] - 1, half[1:])
    return spans


def edge_lines(vertices: np.ndarray, counts: np.ndarray) -> np.ndarray:
    """Edges of convex counter-clockwise polygons as lines, float64 ``[..., k, 4]``: (a, b, c, 1 / a) with a x + b y + c the
    distance from (x, y) to the line of edge k, positive inside; 0 for 1 / a where the line nearly runs along a row.

    Args:
        vertices: float64 ``[..., k, 2]``; counts: int ``[...]``, how many of them count.
    """
    room = vertices.shape[-2]
    following = (np.arange(room) + 1) % np.maximum(counts, 1)[..., None]
    step = np.take_along_axis(vertices, following[..., None], axis=-2) - vertices
    length = np.sqrt((step**2).sum(-1))
    normal = np.stack([-step[..., 1], step[..., 0]], axis=-1) / np.where(length > 0, length, 1.0)[..., None]
    distance = -(normal * vertices).sum(-1, keepdims=True)
    inclined = np.abs(normal[..., :1]) > LEVEL_EDGE
    inverse = np.divide(1.0, normal[..., :1], out=np.zeros_like(distance), where=inclined)
    return np.concatenate([normal, distance, inverse], axis=-1)


@cached(**KERNEL_OPTIONS)
def paint_backgrounds(values, level, rows, geometry, canvas, texels, floor, floors, backgrounds, chosen):
    """Paint floor ``floor[env]`` and the tiles of environments ``rows``: highest Order first, so the lowest is on top."""
    for r in range(len(rows)):
        env = rows[r]
        size = backgrounds.shape[1]
        copy_bytes(backgrounds, env * size, floors, floor[env] * size, size)
        stamp_tiles(
            values, env, level[env], geometry, canvas, texels, backgrounds, env * size, 0, canvas.resolution - 1, chosen
        )


@cached(**KERNEL_OPTIONS)
def draw_frames(values, level, rows, geometry, canvas, texels, backgrounds, frames, stride, chosen):
    """Copy each environment's background into ``frames[env * stride :]`` and stamp its objects: highest Order on top."""
    for r in range(len(rows)):
        env = rows[r]
        size = backgrounds.shape[1]
        copy_bytes(frames, env * stride, backgrounds, env * size, size)
        stamp_objects(
            values, env, level[env], geometry, canvas, texels, frames, env * stride, 0, canvas.resolution - 1, chosen
        )


@cached(**KERNEL_OPTIONS)
def paint_rows(values, level, frame_rows, geometry, canvas, texels, floor, floors, backgrounds, chosen):
    """:func:`paint_backgrounds` of single rows: row ``k % resolution`` of environment ``k // resolution`` for each k."""
    for r in range(len(frame_rows)):
        env, row = frame_rows[r] // canvas.resolution, frame_rows[r] % canvas.resolution
        size = backgrounds.shape[1]
        copy_row(backgrounds, env * size, floors, floor[env] * size, row, canvas)
        stamp_tiles(values, env, level[env], geometry, canvas, texels, backgrounds, env * size, row, row, chosen)


@cached(**KERNEL_OPTIONS)
def draw_rows(values, level, frame_rows, geometry, canvas, texels, backgrounds, frames, stride, chosen):
    """:func:`draw_frames` of single rows: row ``k % resolution`` of environment ``k // resolution`` for each k."""
    for r in range(len(frame_rows)):
        env, row = frame_rows[r] // canvas.resolution, frame_rows[r] % canvas.resolution
        copy_row(frames, env * stride, backgrounds, env * backgrounds.shape[1], row, canvas)
        stamp_objects(values, env, level[env], geometry, canvas, texels, frames, env * stride, row, row, chosen)


@cached(**KERNEL_OPTIONS)
def copy_row(frames, begin, source, source_begin, row, canvas):
    """Copy a row of the frame at byte ``source_begin`` to the frame at byte ``begin``."""
    length = canvas.resolution * canvas.texel
    for plane in range(canvas.planes):
        at = (plane * canvas.resolution + row) * length
        copy_bytes(frames, begin + at, source, source_begin + at, length)


@cached(**KERNEL_OPTIONS, forceinline=True)
def stamp_tiles(values, env, level, geometry, canvas, texels, frames, begin, upper, lower, chosen):
    """Draw the rows ``upper`` to ``lower`` of all tiles into the frame at byte ``begin``."""
    n = sort_by_order(values, env, level, geometry, True, chosen)
    for k in range(n - 1, -1, -1):
        stamp(values, env, level, chosen[k], geometry, canvas, True, texels, frames, begin, upper, lower)


@cached(**KERNEL_OPTIONS, forceinline=True)
def stamp_objects(values, env, level, geometry, canvas, texels, frames, begin, upper, lower, chosen):
    """Draw the rows ``upper`` to ``lower`` of all objects into the frame at byte ``begin``."""
    n = sort_by_order(values, env, level, geometry, False, chosen)
    for k in range(n):
        stamp(values, env, level, chosen[k], geometry, canvas, False, texels, frames, begin, upper, lower)


# Below, arrays are passed whole with indices: a view of one row costs more than what is done with it.


@cached(**KERNEL_OPTIONS)
def sort_by_order(values, env, level, geometry, floor, chosen):
    """Collect the visible tiles (``floor``) or objects of a level in ascending Order, ties by slot; return how many."""
    n = 0
    for entity in range(geometry.types.shape[1]):
        kind = geometry.types[level, entity]
        if kind < 0 or geometry.is_floor[kind] != floor or geometry.columns[kind, POSITION] < 0:
            continue
        if geometry.columns[kind, VISIBLE] >= 0 and not values[env, entity, geometry.columns[kind, VISIBLE]] > 0.0:
            continue
        order = order_of(values, env, level, entity, geometry)
        k = n
        while k > 0 and order_of(values, env, level, chosen[k - 1], geometry) > order:
            chosen[k] = chosen[k - 1]
            k -= 1
        chosen[k] = entity
        n += 1
    return n


@cached(**KERNEL_OPTIONS)
def order_of(values, env, level, entity, geometry):
    column = geometry.columns[geometry.types[level, entity], ORDER]
    return values[env, entity, column] if column >= 0 else 0.0


@cached(**KERNEL_OPTIONS)
def stamp(values, env, level, entity, geometry, canvas, is_tile, texels, frames, begin, upper, lower):
    """Draw the rows ``upper`` to ``lower`` of one entity, if it has a finite place, into the frame at byte ``begin``; tiles
    always have an outline, others if they are mobile."""
    kind = geometry.types[level, entity]
    x = values[env, entity, geometry.columns[kind, POSITION]]
    y = values[env, entity, geometry.columns[kind, POSITION] + 1]
    if not (math.isfinite(x) and math.isfinite(y)):
        return
    outlined = is_tile
    if not is_tile and geometry.columns[kind, MOBILE] >= 0:
        outlined = values[env, entity, geometry.columns[kind, MOBILE]] > 0.0
    if geometry.kinds[level, entity] == CIRCLE:
        diameter = values[env, entity, geometry.columns[kind, SIZE]]
        if diameter >= 0.0:
            stamp_disc(env, entity, x, y, diameter / 2, outlined, geometry, canvas, texels, frames, begin, upper, lower)
    elif geometry.kinds[level, entity] == HULL:
        stamp_hull(env, level, entity, x, y, outlined, geometry, canvas, texels, frames, begin, upper, lower)


@cached(**KERNEL_OPTIONS)
def stamp_disc(env, entity, x, y, radius, outlined, geometry, canvas, texels, frames, begin, upper, lower):
    cx, cy = column_at(x, canvas), canvas.resolution - column_at(y, canvas)
    r = int(np.rint(min(radius * canvas.scale, float(canvas.resolution))))
    first_row = max(cy - r, upper)
    period = texels.shape[3]
    r0 = (first_row - cy) % period
    for row in range(first_row, min(cy + r, lower) + 1):
        outer = geometry.spans[r, abs(row - cy), 0]
        inner = geometry.spans[r, abs(row - cy), 1] if outlined else outer
        a, b, c, d = cx - outer, cx + outer, cx - inner, cx + inner
        stamp_row(env, entity, row, a, b, c, d, cx, r0, canvas, texels, frames, begin)
        r0 = r0 + 1 if r0 + 1 < period else 0


@cached(**KERNEL_OPTIONS)
def column_at(x, canvas):
    """The column of a coordinate, or the distance of its row from the bottom; far outside, somewhere outside."""
    limit = 4.0 * canvas.resolution
    return int(np.rint(min(max((x + canvas.walls) * canvas.scale, -limit), limit)))


@cached(**KERNEL_OPTIONS)
def stamp_row(env, entity, row, first, last, inner_first, inner_last, cx, r0, canvas, texels, frames, begin):
    """Fill the columns ``first`` to ``last`` of a row, black but for the pattern's row ``r0`` from ``inner_first`` to
    ``inner_last``; column ``cx`` has the pattern's first pixel."""
    first, last = max(first, 0), min(last, canvas.resolution - 1)
    inner_first, inner_last = max(inner_first, 0), min(inner_last, canvas.resolution - 1)
    if first > last:
        return
    period = texels.shape[3]
    at = ((inner_first - cx) % period) * canvas.texel
    run = texels.shape[4] - (period - 1) * canvas.texel
    for plane in range(canvas.planes):
        start = begin + (plane * canvas.resolution + row) * canvas.resolution * canvas.texel
        if first < inner_first or inner_last < last:
            clear_bytes(frames, start + first * canvas.texel, (last - first + 1) * canvas.texel)
        to = start + inner_first * canvas.texel
        source = (((env * texels.shape[1] + entity) * canvas.planes + plane) * period + r0) * texels.shape[4] + at
        left = (inner_last - inner_first + 1) * canvas.texel
        while left > 0:
            copy_bytes(frames, to, texels, source, min(left, run))
            to += run
            left -= run


@cached(**KERNEL_OPTIONS)
def stamp_hull(env, level, entity, x, y, outlined, geometry, canvas, texels, frames, begin, upper, lower):
    """Fill the pixels whose world point lies in a convex polygon; those within one pixel of an edge are its outline."""
    left, right, bottom, top = np.inf, -np.inf, np.inf, -np.inf
    for k in range(geometry.vertex_counts[level, entity]):
        left = min(left, geometry.vertices[level, entity, k, 0])
        right = max(right, geometry.vertices[level, entity, k, 0])
        bottom = min(bottom, geometry.vertices[level, entity, k, 1])
        top = max(top, geometry.vertices[level, entity, k, 1])
    resolution, scale, edge = canvas.resolution, canvas.scale, float(canvas.resolution)
    first = int(min(max(np.ceil((x + left + canvas.walls) * scale), 0.0), edge))
    last = int(min(max(np.floor((x + right + canvas.walls) * scale), -1.0), edge - 1.0))
    first_row = int(min(max(np.ceil(resolution - (y + top + canvas.walls) * scale), 0.0), edge))
    last_row = int(min(max(np.floor(resolution - (y + bottom + canvas.walls) * scale), -1.0), edge - 1.0))
    cx, cy = column_at(x, canvas), resolution - column_at(y, canvas)
    for row in range(max(first_row, upper), min(last_row, lower) + 1):
        py = (resolution - row) / scale - canvas.walls - y
        a, b = hull_span(level, entity, x, py, 0.0, first, last, geometry, canvas)
        if a > b:
            continue
        c, d = hull_span(level, entity, x, py, 1.0, a, b, geometry, canvas) if outlined else (a, b)
        r0 = (row - cy) % texels.shape[3]
        stamp_row(env, entity, row, a, b, c, d, cx, r0, canvas, texels, frames, begin)


@cached(**KERNEL_OPTIONS)
def hull_span(level, entity, x, py, depth, first, last, geometry, canvas):
    """First and last of the columns ``first`` to ``last`` whose pixels lie at least ``depth`` pixels within a hull.

    Each edge bounds the columns on one side. An estimate finds the bound to a rounding; the distance itself decides, so
    that the span holds exactly the pixels for which all distances are large enough.
    """
    within = depth / canvas.scale
    for k in range(geometry.vertex_counts[level, entity]):
        a, rest = geometry.edges[level, entity, k, 0], geometry.edges[level, entity, k, 1] * py
        c, inverse = geometry.edges[level, entity, k, 2], geometry.edges[level, entity, k, 3]
        bound = ((within - c - rest) * inverse + x + canvas.walls) * canvas.scale
        if inverse != 0.0 and (bound < first - 1 if a > 0.0 else bound > last + 1):
            continue
        if a >= 0.0:
            at = int(min(max(np.ceil(bound), float(first)), float(last + 1))) if inverse != 0.0 else first
            while at > first and depth_at(at - 1, x, a, rest, c, canvas) >= depth:
                at -= 1
            while at <= last and depth_at(at, x, a, rest, c, canvas) < depth:
                at += 1
            first = at
        else:
            at = int(max(min(np.floor(bound), float(last)), float(first - 1))) if inverse != 0.0 else last
            while at < last and depth_at(at + 1, x, a, rest, c, canvas) >= depth:
                at += 1
            while at >= first and depth_at(at, x, a, rest, c, canvas) < depth:
                at -= 1
            last = at
    return first, last


@cached(**KERNEL_OPTIONS)
def depth_at(column, x, a, rest, c, canvas):
    """How far inside an edge the pixel of a column lies, in pixels."""
    return (a * (column / canvas.scale - canvas.walls - x) + rest + c) * canvas.scale
