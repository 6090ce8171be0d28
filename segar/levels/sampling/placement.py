"""Placement: distinct heights in the pile, minimum distances, and moving things out of walls and of each other."""

from itertools import combinations
from typing import Any

import numpy as np

from segar.language import CIRCLE, HULL, Object, Position, Size
from segar.levels.level_data import LevelData

ARENA_LOW, ARENA_HIGH = -1.0, 1.0  # [m] where the walls stand
MIN_DISTANCE = 0.1  # [m] centres of any two things start farther apart than this (2022)
PLACEMENT_TRIES = 100  # positions of a level are drawn anew at most so often (2022)
OVERLAP_PASSES = 200  # rounds of moving things apart before giving up (2022)
WALL_MARGIN = 1e-5  # [m] left between a thing and the wall that it is moved out of (2022)
CONTACT_THRESHOLD = 1e-7  # [m] objects nearer than this count as overlapping (2022)
SLACK = 1e-6  # [m] gap left between objects that are moved apart, so that the moving ends


def too_close(position: np.ndarray, min_distance: float) -> np.ndarray:
    """Whether some two things of a level are not farther apart than ``min_distance``; bool ``(n,)``.

    Args:
        position: float64 ``(n, things, 2)``, nan for a thing that is absent.
        min_distance: metres.
    """
    close = np.zeros(len(position), dtype=bool)
    for i, j in combinations(range(position.shape[1]), 2):
        dx, dy = (position[:, i] - position[:, j]).T
        close |= dx * dx + dy * dy <= min_distance**2
    return close


def closest_pair(position: np.ndarray) -> tuple[int, int, float]:
    """The two things of one level (float64 ``(things, 2)``, nan absent) that are closest, and their distance."""
    offset = position[:, None] - position[None]
    distance = np.sqrt((offset**2).sum(axis=-1))
    distance[np.isnan(distance) | np.tri(len(position), dtype=bool)] = np.inf
    i, j = np.unravel_index(distance.argmin(), distance.shape)
    return int(i), int(j), float(distance[i, j])


def random_ranks(rng: Any, present: np.ndarray) -> np.ndarray:
    """A random ranking 0, 1, 2... of each level's things that are ``present`` (bool ``(n, things)``); int64."""
    heights = np.where(present, rng.random(present.shape), 2.0)  # the absent rank last
    return heights.argsort(axis=1, kind="stable").argsort(axis=1, kind="stable")


def fix_levels(levels: LevelData) -> np.ndarray:
    """Fix overlaps in ``levels.values`` in place, and return the int indices of the levels where that failed."""
    layout = levels.layout
    if Position not in layout.columns:
        return np.zeros(0, dtype=int)
    place = layout.columns_of(Position)
    position = levels.values[:, :, place]
    size = levels.values[:, :, layout.columns[Size]] if Size in layout.columns else np.zeros(position.shape[:2])
    radius = np.where(levels.shape_kind == CIRCLE, size / 2, 0.0)
    high = np.repeat(radius[..., None], 2, axis=-1)
    low = -high
    hull = levels.shape_kind == HULL
    if hull.any():
        vertices = levels.vertices[hull]
        inside = (np.arange(vertices.shape[1]) < levels.vertex_count[hull][:, None])[..., None]
        low[hull] = np.where(inside, vertices, np.inf).min(axis=1)
        high[hull] = np.where(inside, vertices, -np.inf).max(axis=1)
        radius[hull] = np.sqrt((vertices**2).sum(axis=-1)).max(axis=1)
    is_object = np.array([*(issubclass(t, Object) for t in layout.types), False])
    solid = is_object[levels.types] & (levels.shape_kind > 0)
    levels.values[:, :, place], stuck = fix_overlaps(position, low, high, radius, solid)
    return stuck


def fix_overlaps(
    position: np.ndarray, low: np.ndarray, high: np.ndarray, radius: np.ndarray, solid: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Positions with everything inside the walls and no two solid things overlapping, and the levels where it failed.

    Each pass moves things out of the walls, then each overlapping pair apart, half of the penetration each; nothing is
    random and no level depends on another.

    Args:
        position: float64 ``(n, things, 2)``, nan for a thing that is absent or has no place.
        low, high: float64 ``(n, things, 2)``, a thing's lowest and highest point relative to its position.
        radius: float64 ``(n, things)``, of the disc that a solid thing keeps free of others.
        solid: bool ``(n, things)``, which things push each other (objects do, tiles do not).

    Returns:
        float64 positions, and the int indices of levels that still overlap after 200 passes or do not fit the arena.
    """
    fixed, rows = position.copy(), np.arange(len(position))
    floor, ceiling = ARENA_LOW - low + WALL_MARGIN, ARENA_HIGH - high - WALL_MARGIN
    too_big = (floor > ceiling).any(axis=(1, 2))
    x, rows = position[~too_big].copy(), rows[~too_big]
    floor, ceiling, radius, solid = floor[rows], ceiling[rows], radius[rows], solid[rows]
    for _ in range(OVERLAP_PASSES):
        np.clip(x, floor, ceiling, out=x)
        moved = _push_apart(x, radius, solid)
        fixed[rows[~moved]] = x[~moved]
        x, rows, floor, ceiling = x[moved], rows[moved], floor[moved], ceiling[moved]
        radius, solid = radius[moved], solid[moved]
        if not len(rows):
            break
    return fixed, np.union1d(rows, np.flatnonzero(too_big))


def _push_apart(x: np.ndarray, radius: np.ndarray, solid: np.ndarray) -> np.ndarray:
    """Move overlapping solid pairs of ``x`` apart, in place; whether anything moved, bool ``(n,)``."""
    moved = np.zeros(len(x), dtype=bool)
    for i, j in combinations(np.flatnonzero(solid.any(axis=0)), 2):
        dx, dy = (x[:, j] - x[:, i]).T
        distance = np.sqrt(dx * dx + dy * dy)
        depth = radius[:, i] + radius[:, j] + CONTACT_THRESHOLD - distance
        hit = np.flatnonzero((depth >= 0) & solid[:, i] & solid[:, j])
        if not len(hit):
            continue
        moved[hit] = True
        apart = np.stack([dx[hit], dy[hit]], axis=-1)
        apart[distance[hit] == 0] = (1.0, 0.0)  # one upon the other: any direction will do
        apart *= ((depth[hit] + SLACK) / (2 * np.where(distance[hit] == 0, 1.0, distance[hit])))[:, None]
        x[hit, i] -= apart
        x[hit, j] += apart
    return moved
