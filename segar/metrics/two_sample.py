"""Two-sample tests on whole levels, which see how factors depend on each other: energy, kernel and classifier tests."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import scipy

from segar.errors import LevelError
from segar.language import Factor
from segar.levels import Levels, require_generator, require_levels
from segar.metrics.embedding import embed
from segar.metrics.points import Spread

FEATURES = 200  # random Fourier features of the classifier
RIDGE = 1e-2  # weight of the squared coefficients against the mean loss
FEWEST = 8  # levels per set: half of them train the classifier, half test it


@dataclass(frozen=True)
class TwoSampleTest:
    """A statistic and the test of one distribution for both sets.

    Attributes:
        name: ``"energy"``, ``"mmd"`` or ``"classifier"``.
        value: the statistic.
        floor: what it is on average if both sets have one distribution.
        p_value: of the hypothesis of one distribution, exact for levels that are drawn independently.
    """

    name: str
    value: float
    floor: float
    p_value: float


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
    vectors = _pooled("energy_test", a, b, rng, scale, factors)
    return _permutation_test("energy", -_distances(vectors), len(a), rng, resamples)


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
    distances = _distances(_pooled("mmd_test", a, b, rng, scale, factors))
    h = median_distance(distances) if bandwidth is None else bandwidth
    if not 0 < h < np.inf:
        raise LevelError(f"mmd_test: the bandwidth must be a positive number, not {bandwidth!r}")
    return _permutation_test("mmd", np.exp(-0.5 * (distances / h) ** 2), len(a), rng, resamples)


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
    vectors = _pooled("classifier_test", a, b, rng, scale, factors)
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
    return TwoSampleTest("classifier", float(test.statistic) / pairs, 0.5, float(test.pvalue))


def _pooled(
    what: str,
    a: Levels,
    b: Levels,
    rng: np.random.Generator,
    scale: Spread | None,
    factors: Sequence[type[Factor]] | None,
) -> np.ndarray:
    require_levels(what, a, b)
    require_generator(what, rng)
    return np.concatenate(embed(a, b, scale=scale, factors=factors))


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
