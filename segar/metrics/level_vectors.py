"""Levels as vectors, a Euclidean approximation of their distance, and two-sample tests on these: energy, kernel, classifier."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import scipy

from segar.errors import LevelError
from segar.language import Factor
from segar.levels import Levels, PointSets, checks, entity_types
from segar.metrics.points import Spread, Units
from segar.metrics.unseen import warn_of_unseen
from segar.metrics.wasserstein import MISMATCH

DIRECTIONS = 50  # at least so many for a type that a level can have several of; as many as the 2022 code projects on
LARGEST_FRAME = 64  # dimensions; to make a frame takes the cube of them
DIRECTIONS_SEED = 0  # the directions are part of what the vectors mean, hence always the same ones
FEATURES = 200  # random Fourier features of the classifier
RIDGE = 1e-2  # weight of the squared coefficients against the mean loss
FEWEST = 8  # levels per set: half of them train the classifier, half test it


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
    units = Units.checked("embed", sets, scale, factors)
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
class TwoSampleTest:
    """A statistic and the test of one distribution for both sets.

    Attributes:
        name: ``"energy"``, ``"mmd"`` or ``"classifier"``.
        value: the statistic.
        floor: what it is on average if both sets have one distribution.
        p_value: of the hypothesis of one distribution, exact for levels that are drawn independently.
        unseen: in what the sets differ that the distance does not see; see :func:`segar.metrics.unseen_differences`.
    """

    name: str
    value: float
    floor: float
    p_value: float
    unseen: tuple[str, ...] = ()


def energy_test(
    a: Levels,
    b: Levels,
    *,
    rng: np.random.Generator,
    resamples: int = 999,
    scale: Spread | None = None,
    factors: Sequence[type[Factor]] | None = None,
) -> TwoSampleTest:
    """The energy distance sqrt(2 E|X - Y| - E|X - X'| - E|Y - Y'|) of levels as vectors, with its permutation test.

    It is zero for equal samples only (Székely and Rizzo 2013). For one number per level it is
    ``scipy.stats.energy_distance``.

    Args:
        rng: deals the levels anew, ``resamples`` times.
        scale, factors: as for :func:`segar.metrics.embed`, which makes the vectors.

    Raises:
        LevelError: not two level sets.
    """
    checks.require_levels("energy_test", a, b)
    checks.require_generator("energy_test", rng)
    vectors = np.concatenate(embed(a, b, scale=scale, factors=factors))
    found = _permutation_test("energy", -_distances(vectors), len(a), rng, resamples)
    return replace(found, unseen=warn_of_unseen("energy_test", a, b, "exact", factors))


def mmd_test(
    a: Levels,
    b: Levels,
    *,
    rng: np.random.Generator,
    resamples: int = 999,
    bandwidth: float | None = None,
    scale: Spread | None = None,
    factors: Sequence[type[Factor]] | None = None,
) -> TwoSampleTest:
    """The maximum mean discrepancy sqrt(E k(X,X') + E k(Y,Y') - 2 E k(X,Y)) with its permutation test.

    k(x, y) = exp(-|x - y|^2 / 2 h^2) on levels as vectors (Gretton et al. 2012, biased estimate); ``bandwidth`` h is the
    median distance of all levels by default. Other arguments and errors are those of :func:`energy_test`.
    """
    checks.require_levels("mmd_test", a, b)
    checks.require_generator("mmd_test", rng)
    distances = _distances(np.concatenate(embed(a, b, scale=scale, factors=factors)))
    h = median_distance(distances) if bandwidth is None else bandwidth
    if not 0 < h < np.inf:
        raise LevelError(f"mmd_test: the bandwidth must be a positive number, not {bandwidth!r}")
    found = _permutation_test("mmd", np.exp(-0.5 * (distances / h) ** 2), len(a), rng, resamples)
    return replace(found, unseen=warn_of_unseen("mmd_test", a, b, "exact", factors))


def classifier_test(
    a: Levels,
    b: Levels,
    *,
    rng: np.random.Generator,
    scale: Spread | None = None,
    factors: Sequence[type[Factor]] | None = None,
) -> TwoSampleTest:
    """How well a classifier separates unseen levels of b from unseen levels of a: the area under its ROC curve.

    1/2 is chance, 1 is perfect. Half of each set, picked by ``rng``, is learnt from by logistic regression on the vectors
    and their random Fourier features (Rahimi and Recht 2007), so that dependence shows; on the other halves, the
    Mann-Whitney test of its scores is the test of one distribution (Lopez-Paz and Oquab 2017, with ranks in place of accuracy,
    so that sets may differ in size).

    Raises:
        LevelError: not two level sets, or one with fewer than 8 levels.
    """
    checks.require_levels("classifier_test", a, b)
    checks.require_generator("classifier_test", rng)
    vectors = np.concatenate(embed(a, b, scale=scale, factors=factors))
    if min(len(a), len(b)) < FEWEST:
        raise LevelError(f"classifier_test needs at least {FEWEST} levels in each set, not {len(a)} and {len(b)}")
    learn = np.zeros(len(vectors), dtype=bool)
    for first, n in ((0, len(a)), (len(a), len(b))):
        learn[first + rng.permutation(n)[: n // 2]] = True
    is_b = np.arange(len(vectors)) >= len(a)
    features = _fourier_features(vectors, learn, rng)
    scores = features @ _logistic_regression(features[learn], is_b[learn])
    # Levels that are equal up to rounding are ties.
    scores = np.round(scores, 9)
    test = scipy.stats.mannwhitneyu(scores[~learn & is_b], scores[~learn & ~is_b], alternative="greater")
    pairs = int((~learn & is_b).sum()) * int((~learn & ~is_b).sum())
    unseen = warn_of_unseen("classifier_test", a, b, "exact", factors)
    return TwoSampleTest("classifier", float(test.statistic) / pairs, 0.5, float(test.pvalue), unseen)


def _permutation_test(name: str, kernel: np.ndarray, n: int, rng: np.random.Generator, resamples: int) -> TwoSampleTest:
    """The root of s' K s, with s = 1/n on the first n levels and -1/m on the rest, against its values for dealt levels."""
    if resamples < 19:
        raise LevelError(f"the {name} test needs at least 19 resamples, not {resamples}")
    total = len(kernel)
    signs = np.where(np.arange(total) < n, 1 / n, -1 / (total - n))
    dealt = np.stack([signs, *(rng.permutation(signs) for _ in range(resamples))])
    squares = np.maximum(np.einsum("ri,ri->r", dealt @ kernel, dealt), 0.0)
    # Equal deals give equal squares up to rounding.
    reached = squares[1:] >= squares[0] - 1e-12 * np.abs(kernel).max()
    return TwoSampleTest(
        name=name,
        value=float(np.sqrt(squares[0])),
        floor=float(np.sqrt(squares[1:]).mean()),
        p_value=float((1 + reached.sum()) / (1 + resamples)),
    )


def _distances(vectors: np.ndarray) -> np.ndarray:
    return scipy.spatial.distance.cdist(vectors, vectors)


def median_distance(distances: np.ndarray) -> float:
    """The median of the distances of all pairs, from float64 ``[n, n]``; the largest, else 1, where the median is 0."""
    pairs = distances[np.triu_indices(len(distances), 1)]
    return float(np.median(pairs)) or float(pairs.max()) or 1.0


def _fourier_features(vectors: np.ndarray, learn: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """A one, the vectors, and cosines of random projections; scaled by what is learnt from: float64 ``[levels, features]``."""
    centred = vectors - vectors[learn].mean(axis=0)
    h = median_distance(_distances(vectors[learn]))
    frequencies = rng.standard_normal((vectors.shape[1], FEATURES)) / h
    phases = rng.uniform(0.0, 2 * np.pi, FEATURES)
    waves = np.cos(centred @ frequencies + phases) * np.sqrt(2.0 / FEATURES)
    return np.concatenate([np.ones((len(vectors), 1)), centred / h, waves], axis=1)


def _logistic_regression(features: np.ndarray, labels: np.ndarray) -> np.ndarray:
    """Coefficients that minimise the mean logistic loss plus a ridge on all but the first; both classes weigh the same."""
    sign = np.where(labels, 1.0, -1.0)
    weight = np.where(labels, 0.5 / labels.sum(), 0.5 / (~labels).sum())
    ridge = np.full(features.shape[1], RIDGE)
    ridge[0] = 0.0

    def loss(w: np.ndarray) -> tuple[float, np.ndarray]:
        margin = sign * (features @ w)
        value = weight @ np.logaddexp(0.0, -margin) + 0.5 * ridge @ w**2
        return float(value), -(features.T @ (weight * sign * scipy.special.expit(-margin))) + ridge * w

    return scipy.optimize.minimize(loss, np.zeros(features.shape[1]), jac=True, method="L-BFGS-B").x
