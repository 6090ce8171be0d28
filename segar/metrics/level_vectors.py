"""Levels as vectors, a Euclidean approximation of their distance; the sliced distance, and a two-sample test on these."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import scipy

from segar.language import Factor
from segar.levels import Levels, PointSets, checks, entity_types
from segar.metrics.points import Spread, Units
from segar.metrics.transport import quantile_steps
from segar.metrics.unseen import warn_of_unseen
from segar.metrics.wasserstein import MISMATCH

DIRECTIONS = 50  # at least so many for a type that a level can have several of; as many as the 2022 code projects on
LARGEST_FRAME = 64  # dimensions; to make a frame takes the cube of them
DIRECTIONS_SEED = 0  # the directions are part of what the vectors mean, hence always the same ones
PROJECTIONS = 500  # of a sliced distance
LEAST_RESAMPLES = 19  # with which a p-value can be 0.05


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
    negative type, as MMD and energy distances need it.

    Args:
        scale, factors: as for :func:`segar.metrics.w2`; default units: ``spread(*sets)``.

    Raises:
        LevelError: one of the sets is not a level set.
    """
    units = Units.checked("embed", sets, scale, factors)
    checks.require_size("embed", "mismatch", mismatch)
    types = entity_types(*sets)
    blocks = [_bags([_unrolled(units.state(levels, entity)) for levels in sets], mismatch) for entity in types]
    varied = units.parameters(*sets)
    if varied:
        blocks.append([_unrolled(units.world(levels, varied)).points for levels in sets])
    return [
        np.concatenate([np.zeros((len(levels), 0)), *(block[k] for block in blocks)], axis=1)
        for k, levels in enumerate(sets)
    ]


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


@dataclass(frozen=True)
class SlicedW2:
    """A sliced distance.

    Attributes:
        value: the distance.
        standard_error: that of having drawn so many ``projections`` and no more.
        unseen: in what the sets differ that the distance does not see; see :func:`segar.metrics.unseen_differences`.
    """

    value: float
    standard_error: float
    projections: int
    unseen: tuple[str, ...] = ()


def w2_sliced(
    a: Levels,
    b: Levels,
    *,
    rng: np.random.Generator,
    mismatch: float = MISMATCH,
    scale: Spread | None = None,
    factors: Sequence[type[Factor]] | None = None,
) -> SlicedW2:
    """The sliced Wasserstein-2 distance of two level sets, SW = sqrt(D mean over directions of W2^2 along it).

    Levels are the vectors of :func:`segar.metrics.embed` in D dimensions; the factor D makes it |x - y| for sets of one
    level each, and for a set and its translate. But for the choice of directions, it is at most the exact distance of
    these vectors. Its error from having n levels falls as n^-1/2 whatever D, where that of the exact distance falls as
    n^(-1/D); but it sees less: sets that look alike along every line nearly look equal. Time and memory grow as n D.

    Args:
        rng: draws the directions; 500 of them, or a few more to fill orthonormal frames.
        mismatch, scale, factors: as for :func:`segar.metrics.w2`.

    Raises:
        LevelError: not two level sets.

    Source: Bonneel et al. 2015.
    """
    checks.require_levels("w2_sliced", a, b)
    checks.require_generator("w2_sliced", rng)
    x, y = embed(a, b, scale=scale, mismatch=mismatch, factors=factors)
    unseen = warn_of_unseen("w2_sliced", a, b, "exact", factors, scale)
    dimension = x.shape[1]
    if dimension == 0:
        return SlicedW2(0.0, 0.0, 0, unseen)
    directions = frames(dimension, PROJECTIONS, rng)
    rows, columns, widths = quantile_steps(len(x), len(y))
    apart = np.sort(x @ directions, axis=0)[rows] - np.sort(y @ directions, axis=0)[columns]
    squares = dimension * (widths @ apart**2)
    value = float(np.sqrt(squares.mean()))
    error = float(squares.std(ddof=1) / np.sqrt(len(squares)))
    return SlicedW2(value, error / (2 * value) if value > 0 else 0.0, len(squares), unseen)


@dataclass(frozen=True)
class TwoSampleTest:
    """A statistic and the test of one distribution for both sets.

    Attributes:
        value: the statistic.
        floor: what it is on average if both sets have one distribution.
        p_value: of the hypothesis of one distribution, exact for levels that are drawn independently.
        unseen: in what the sets differ that the distance does not see; see :func:`segar.metrics.unseen_differences`.
    """

    value: float
    floor: float
    p_value: float
    unseen: tuple[str, ...] = ()


def mmd_test(
    a: Levels,
    b: Levels,
    *,
    rng: np.random.Generator,
    resamples: int = 999,
    scale: Spread | None = None,
    factors: Sequence[type[Factor]] | None = None,
) -> TwoSampleTest:
    """The maximum mean discrepancy sqrt(E k(X,X') + E k(Y,Y') - 2 E k(X,Y)) with its permutation test.

    k(x, y) = exp(-|x - y|^2 / 2 h^2) on levels as vectors, with their median distance as h (Gretton et al. 2012, biased
    estimate). It is zero for equal samples only.

    Args:
        rng: deals the levels anew, ``resamples`` times.
        scale, factors: as for :func:`segar.metrics.embed`, which makes the vectors.

    Raises:
        LevelError: not two level sets, or fewer than 19 resamples.
    """
    checks.require_levels("mmd_test", a, b)
    checks.require_generator("mmd_test", rng)
    vectors = np.concatenate(embed(a, b, scale=scale, factors=factors))
    distances = scipy.spatial.distance.cdist(vectors, vectors)
    checks.require_count("mmd_test", "resamples", resamples, LEAST_RESAMPLES)
    kernel = np.exp(-0.5 * (distances / median_distance(distances)) ** 2)
    # The statistic is the root of s' K s, with s = 1/n on the levels of a and -1/m on those of b.
    n, total = len(a), len(kernel)
    signs = np.where(np.arange(total) < n, 1 / n, -1 / (total - n))
    dealt = np.stack([signs, *(rng.permutation(signs) for _ in range(resamples))])
    squares = np.maximum(np.einsum("ri,ri->r", dealt @ kernel, dealt), 0.0)
    # Equal deals give equal squares up to rounding.
    reached = squares[1:] >= squares[0] - 1e-12 * np.abs(kernel).max()
    return TwoSampleTest(
        value=float(np.sqrt(squares[0])),
        floor=float(np.sqrt(squares[1:]).mean()),
        p_value=float((1 + reached.sum()) / (1 + resamples)),
        unseen=warn_of_unseen("mmd_test", a, b, "exact", factors),
    )


def median_distance(distances: np.ndarray) -> float:
    """The median of the distances of all pairs, from float64 ``[n, n]``; the largest, else 1, where the median is 0."""
    pairs = distances[np.triu_indices(len(distances), 1)]
    return float(np.median(pairs)) or float(pairs.max()) or 1.0
