"""The compiled kernel of the pixel observation: paint static backgrounds, copy them, stamp what moves.

A frame is ``uint8[3 * resolution**2]``, rows from the top, RGB interleaved. World coordinates become pixels as in 2022:
``px = rint((x - lo) res / (hi - lo))`` and ``py = res - rint((y - lo) res / (hi - lo))``. Every environment is drawn by
itself, so a frame does not depend on the batch that it is part of.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from segar.shapes import CIRCLE, HULL

ARENA_LOW = -1.0
ARENA_WIDTH = 2.0

# Columns of ``columns[type]``: where a type keeps what the kernel reads; -1 where it lacks the factor.
POSITION, SIZE, VISIBLE, ORDER, MOBILE, TINT = range(6)

# Nothing here allocates, so numba's reference counting of arrays, which costs as much as the drawing, is off.
_options = {"nogil": True, "cache": True, "error_model": "numpy", "_nrt": False}


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
    """Edges of convex counter-clockwise polygons as lines, float64 ``[..., k, 3]``: (a, b, c) with a x + b y + c the
    distance from (x, y) to the line of edge k, positive inside.

    Args:
        vertices: float64 ``[..., k, 2]``; counts: int ``[...]``, how many of them count.
    """
    room = vertices.shape[-2]
    following = (np.arange(room) + 1) % np.maximum(counts, 1)[..., None]
    step = np.take_along_axis(vertices, following[..., None], axis=-2) - vertices
    length = np.sqrt((step**2).sum(-1))
    normal = np.stack([-step[..., 1], step[..., 0]], axis=-1) / np.where(length > 0, length, 1.0)[..., None]
    return np.concatenate([normal, -(normal * vertices).sum(-1, keepdims=True)], axis=-1)


@njit(**_options)
def paint_backgrounds(
    values, level, mask, types, kinds, vertex_counts, vertices, edges, columns, is_floor, tints, spans, floor_words,
    background_words, backgrounds, chosen,
):  # fmt: skip
    """Paint the floor and its tiles for each environment in ``mask``: highest Order first, so the lowest is on top."""
    words = background_words.shape[1]
    for env in range(values.shape[0]):
        if not mask[env]:
            continue
        for k in range(words):
            background_words[env, k] = floor_words[k]
        n = sort_by_order(values, env, types, level[env], columns, is_floor, True, chosen)
        for k in range(n - 1, -1, -1):
            stamp(
                values, env, level[env], chosen[k], types, kinds, vertex_counts, vertices, edges, columns, tints, spans,
                True, backgrounds,
            )  # fmt: skip


@njit(**_options)
def draw_frames(
    values, level, rows, types, kinds, vertex_counts, vertices, edges, columns, is_floor, tints, spans,
    background_words, frame_words, frames, chosen,
):  # fmt: skip
    """Copy each environment's background into ``frames[rows]`` and stamp its objects: highest Order on top."""
    words = background_words.shape[1]
    for row in range(len(rows)):
        env = rows[row]
        # A loop over 64-bit words: numba turns a slice assignment into something 30 times slower.
        for k in range(words):
            frame_words[env, k] = background_words[env, k]
        n = sort_by_order(values, env, types, level[env], columns, is_floor, False, chosen)
        for k in range(n):
            stamp(
                values, env, level[env], chosen[k], types, kinds, vertex_counts, vertices, edges, columns, tints, spans,
                False, frames,
            )  # fmt: skip


# Below, arrays are passed whole with indices: a view of one row costs more than what is done with it.


@njit(**_options)
def sort_by_order(values, env, types, level, columns, is_floor, floor, chosen):
    """Collect the visible tiles (``floor``) or objects of a level in ascending Order, ties by slot; return how many."""
    n = 0
    for entity in range(types.shape[1]):
        kind = types[level, entity]
        if kind < 0 or is_floor[kind] != floor or columns[kind, POSITION] < 0:
            continue
        if columns[kind, VISIBLE] >= 0 and not values[env, entity, columns[kind, VISIBLE]] > 0.0:
            continue
        order = order_of(values, env, entity, columns[kind, ORDER])
        k = n
        while k > 0 and order_of(values, env, chosen[k - 1], columns[types[level, chosen[k - 1]], ORDER]) > order:
            chosen[k] = chosen[k - 1]
            k -= 1
        chosen[k] = entity
        n += 1
    return n


@njit(**_options)
def order_of(values, env, entity, column):
    return values[env, entity, column] if column >= 0 else 0.0


@njit(**_options)
def stamp(
    values, env, level, entity, types, kinds, vertex_counts, vertices, edges, columns, tints, spans, is_tile, frames
):
    """Draw one entity, if it has a finite place; tiles always have an outline, others if they are mobile."""
    kind = types[level, entity]
    x = values[env, entity, columns[kind, POSITION]]
    y = values[env, entity, columns[kind, POSITION] + 1]
    if not (math.isfinite(x) and math.isfinite(y)):
        return
    outlined = is_tile
    if not is_tile and columns[kind, MOBILE] >= 0:
        outlined = values[env, entity, columns[kind, MOBILE]] > 0.0
    blend = 0.0
    if columns[kind, TINT] >= 0:
        low, high = tints[kind, 2, 0], tints[kind, 2, 1]
        blend = min(max((values[env, entity, columns[kind, TINT]] - low) / (high - low), 0.0), 1.0)
    red = np.uint8(np.rint(tints[kind, 0, 0] + blend * (tints[kind, 1, 0] - tints[kind, 0, 0])))
    green = np.uint8(np.rint(tints[kind, 0, 1] + blend * (tints[kind, 1, 1] - tints[kind, 0, 1])))
    blue = np.uint8(np.rint(tints[kind, 0, 2] + blend * (tints[kind, 1, 2] - tints[kind, 0, 2])))
    if kinds[level, entity] == CIRCLE:
        diameter = values[env, entity, columns[kind, SIZE]]
        if diameter >= 0.0:
            stamp_disc(x, y, diameter / 2, red, green, blue, outlined, spans, frames, env)
    elif kinds[level, entity] == HULL:
        stamp_hull(
            x,
            y,
            vertices,
            edges,
            vertex_counts,
            level,
            entity,
            red,
            green,
            blue,
            outlined,
            spans.shape[0] - 1,
            frames,
            env,
        )


@njit(**_options)
def stamp_disc(x, y, radius, red, green, blue, outlined, spans, frames, env):
    resolution = spans.shape[0] - 1
    scale = resolution / ARENA_WIDTH
    cx = int(np.rint(min(max((x - ARENA_LOW) * scale, -4.0 * resolution), 4.0 * resolution)))
    cy = resolution - int(np.rint(min(max((y - ARENA_LOW) * scale, -4.0 * resolution), 4.0 * resolution)))
    r = int(np.rint(min(radius * scale, float(resolution))))
    for row in range(max(cy - r, 0), min(cy + r, resolution - 1) + 1):
        outer = spans[r, abs(row - cy), 0]
        if outlined:
            inner = spans[r, abs(row - cy), 1]
            fill(frames, env, row, cx - outer, cx + outer, np.uint8(0), np.uint8(0), np.uint8(0), resolution)
            fill(frames, env, row, cx - inner, cx + inner, red, green, blue, resolution)
        else:
            fill(frames, env, row, cx - outer, cx + outer, red, green, blue, resolution)


@njit(**_options)
def fill(frames, env, row, first, last, red, green, blue, resolution):
    """Colour the pixels ``first`` to ``last`` of a row, as far as they are in the frame."""
    first = max(first, 0)
    at = 3 * (row * resolution + first)
    for _ in range(first, min(last, resolution - 1) + 1):
        frames[env, at] = red
        frames[env, at + 1] = green
        frames[env, at + 2] = blue
        at += 3


@njit(**_options)
def stamp_hull(
    x, y, vertices, edges, vertex_counts, level, entity, red, green, blue, outlined, resolution, frames, env
):
    """Fill the pixels whose world point lies in a convex polygon; those within one pixel of an edge are its outline."""
    scale = resolution / ARENA_WIDTH
    left, right, bottom, top = np.inf, -np.inf, np.inf, -np.inf
    for k in range(vertex_counts[level, entity]):
        left, right = min(left, vertices[level, entity, k, 0]), max(right, vertices[level, entity, k, 0])
        bottom, top = min(bottom, vertices[level, entity, k, 1]), max(top, vertices[level, entity, k, 1])
    edge = float(resolution)
    first_column = int(min(max(np.ceil((x + left - ARENA_LOW) * scale), 0.0), edge))
    last_column = int(min(max(np.floor((x + right - ARENA_LOW) * scale), -1.0), edge - 1.0))
    first_row = int(min(max(np.ceil(resolution - (y + top - ARENA_LOW) * scale), 0.0), edge))
    last_row = int(min(max(np.floor(resolution - (y + bottom - ARENA_LOW) * scale), -1.0), edge - 1.0))
    for row in range(first_row, last_row + 1):
        py = (resolution - row) / scale + ARENA_LOW - y
        for column in range(first_column, last_column + 1):
            px = column / scale + ARENA_LOW - x
            depth = np.inf
            for k in range(vertex_counts[level, entity]):
                d = edges[level, entity, k, 0] * px + edges[level, entity, k, 1] * py + edges[level, entity, k, 2]
                depth = min(depth, d)
            depth *= scale
            if depth >= 1.0 or (depth >= 0.0 and not outlined):
                fill(frames, env, row, column, column, red, green, blue, resolution)
            elif depth >= 0.0:
                fill(frames, env, row, column, column, np.uint8(0), np.uint8(0), np.uint8(0), resolution)
