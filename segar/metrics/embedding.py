"""Levels as vectors: a Euclidean approximation of the distance of levels, for methods that need vectors or many levels."""

from collections.abc import Sequence

import numpy as np

from segar.language import Factor
from segar.levels import Levels, PointSets, entity_types
from segar.metrics.points import (
    Spread,
    checked_units,
    scaled_parameters,
    scaled_state,
    weighed_factors,
    weighed_parameters,
)
from segar.metrics.wasserstein import MISMATCH

DIRECTIONS = 50  # at least so many for a type that a level can have several of; as many as the 2022 code projects on
LARGEST_FRAME = 64  # dimensions; to make a frame takes the cube of them
DIRECTIONS_SEED = 0  # the directions are part of what the vectors mean, hence always the same ones


def embed(
    *sets: Levels,
    scale: Spread | None = None,
    mismatch: float = MISMATCH,
    factors: Sequence[type[Factor]] | None = None,
) -> list[np.ndarray]:
    """One vector per level, float64 ``[levels, D]`` for each set, the same coordinates for all sets of one call.

    Per entity type, a level is a bag of as many points as any level has entities of the type: the relevant factors in
    units of their spread. Missing ones stand at the centre of the type's points, ``mismatch`` away along an axis of
    their own. A type of which levels have one at most is its point itself; of others, the bag is its sorted projections
    on at least 50 directions that make up orthonormal frames. World parameters follow. A factor with a ``period`` is two
    coordinates, a place on a circle of that length: what is far round the circle is nearer here, by up to 36 %.

    So the squared Euclidean distance of two vectors is a sum over types of sliced squared Wasserstein-2 distances times
    their dimension. For types with one entity in each level it is what ``w2(mode="exact")`` takes for the distance of
    levels, short of its cut-off; else it is at most the squared distance of the best matching of the bags. It is of
    negative type, as energy distance and MMD need it.

    Args:
        scale, factors: as for :func:`segar.metrics.w2`; default units: ``spread(*sets)``.

    Raises:
        LevelError: one of the sets is not a level set.
    """
    unit = checked_units("embed", sets, scale, factors)
    columns: list[list[np.ndarray]] = [[] for _ in sets]
    for entity in entity_types(*sets):
        read = weighed_factors(entity, unit, factors)
        _append(columns, _bags([_unrolled(scaled_state(levels, entity, read, unit)) for levels in sets], mismatch))
    varied = weighed_parameters(sets, unit, factors)
    if varied:
        _append(columns, [_unrolled(scaled_parameters(levels, varied, unit)).points for levels in sets])
    return [np.concatenate([np.zeros((len(s), 0)), *found], axis=1) for s, found in zip(sets, columns, strict=True)]


def frames(dimension: int, at_least: int, rng: np.random.Generator) -> np.ndarray:
    """Random unit vectors as columns, float64 ``[dimension, directions]``; in up to 64 dimensions whole orthonormal frames.

    Beyond, independent directions are nearly orthogonal anyway.
    """
    if dimension > LARGEST_FRAME:
        drawn = rng.standard_normal((dimension, at_least))
        return drawn / np.linalg.norm(drawn, axis=0)
    made = []
    for _ in range(-(-at_least // dimension)):
        q, r = np.linalg.qr(rng.standard_normal((dimension, dimension)))
        made.append(q * np.sign(np.diag(r)))
    return np.concatenate(made, axis=1)


def _unrolled(sets: PointSets) -> PointSets:
    """Points whose components with a period have become two each: the place on a circle of that length."""
    if sets.periods is None:
        return sets
    columns = []
    for column, period in zip(sets.points.T, sets.periods, strict=True):
        if np.isinf(period):
            columns.append(column)
        else:
            angle = 2 * np.pi / period * column
            columns += [period / (2 * np.pi) * np.cos(angle), period / (2 * np.pi) * np.sin(angle)]
    return PointSets(sets.counts, np.stack(columns, axis=1))


def _bags(bags: Sequence[PointSets], mismatch: float) -> list[np.ndarray]:
    """Vectors of bags of points, float64 ``[levels, coordinates]`` for each of the sets."""
    counts = np.concatenate([b.counts for b in bags])
    most, dimension = int(counts.max()), bags[0].points.shape[1]
    pooled = np.concatenate([b.points for b in bags])
    centre = pooled.mean(axis=0)
    extra = int(counts.min() < most)
    full = []
    for bag in bags:
        points = np.zeros((len(bag.counts), most, dimension + extra))
        points[:, :, :dimension] = centre
        points[:, :, dimension:] = mismatch
        place = np.arange(most) < bag.counts[:, None]
        points[place] = np.concatenate([bag.points, np.zeros((len(bag.points), extra))], axis=1)
        full.append(points)
    if dimension + extra == 0:
        return [np.zeros((len(b.counts), 0)) for b in bags]
    if most == 1:
        return [points[:, 0] for points in full]
    directions = frames(dimension + extra, DIRECTIONS, np.random.default_rng(DIRECTIONS_SEED))
    # Projections on all vectors of a frame keep the length; the mean over frames is the mean over directions times dimension.
    weight = np.sqrt((dimension + extra) / directions.shape[1])
    return [(np.sort(points @ directions, axis=1) * weight).reshape(len(points), -1) for points in full]


def _append(columns: list[list[np.ndarray]], found: Sequence[np.ndarray]) -> None:
    for of_set, block in zip(columns, found, strict=True):
        of_set.append(block)
