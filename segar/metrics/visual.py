"""Distances between renderers: how differently two sets of textures show the same things."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from math import lcm

import numpy as np
import scipy

from segar.errors import SegarError, did_you_mean
from segar.levels import checks
from segar.metrics.level_vectors import median_distance
from segar.noise import GaussianNoise
from segar.support import emd
from segar.textures import (
    NOISE_CLIP,
    UNIFORM,
    FilterClusters,
    Laws,
    TextureSet,
    cluster_costs,
    is_noise,
    product_of_marginals,
    require_laws,
)

SMALLEST_PATCH = 8  # [pixels] about the size of the smallest things in a picture of 64 pixels
RANDOM_FILTERS = 64
RANDOM_FILTER_SIZE = 5
RANDOM_FILTER_SEED = 0  # fixed, so that the embedding is always the same
FLOORS = 3

Embedding = Callable[[np.ndarray], np.ndarray]


@dataclass(frozen=True)
class Measured:
    """A distance with what it is for one renderer and itself.

    Attributes:
        value: the distance.
        floor: what it is on average between two sets of samples of one renderer (the mean of both renderers').
        standard_error: of ``value``, by the bootstrap over the things that are shown.
    """

    value: float
    floor: float
    standard_error: float


@dataclass(frozen=True)
class VisualDistance:
    """How far apart two renderers are in a feature space.

    Attributes:
        embedding, samples: the space, and how many things were shown to both.
        paired: root mean square distance of the two textures of the same thing. Its floor is that of one renderer that
            shows the same thing twice, with other noise and another of its models.
        frechet: Wasserstein-2 distance of the Gaussians with the same moments; FID is its square. It compares what the
            renderers show on the whole, not which thing looks how.
        mmd: maximum mean discrepancy under a Gaussian kernel whose width is the median distance; likewise.
    """

    embedding: str
    samples: int
    paired: Measured
    frechet: Measured
    mmd: Measured


def visual_w2(a: TextureSet | str, b: TextureSet | str, *, aligned: bool = False, laws: Laws = UNIFORM) -> float:
    """The distance of two renderers in weight space: Wasserstein-2 between their models.

    The squared distance of two models is the mean squared difference, over pixels and over things from the product of
    marginals, of what they make of the same thing before the squash::

        |m - m'|^2 + sum over inputs i of var_i |w_i - w'_i|^2,    m = bias + sum over i of mean_i w_i

    with weights per unit of the value, and 0 for inputs that one of them lacks. The floor counts as an input of variance
    1. Between sets of several models, models are matched by optimal transport with equal weights.

    Args:
        a, b: sets of textures, or names of shipped ones.
        aligned: compare which patterns the renderers use, whichever input each stands for: inputs are matched so that
            the sum is least, as W2 matches points.
        laws: the marginals.

    Raises:
        SegarError: there are no such textures, or no distribution for an input.

    Source: the 2022 renderers of filters were compared so, by W2 between clusterings after assignment.
    """
    a, b = _textures(a), _textures(b)
    names = tuple(dict.fromkeys((*a.inputs, *b.inputs)))
    period = lcm(a.period, b.period)
    patterns_a, patterns_b = (_patterns(textures, names, period, laws) for textures in (a, b))
    costs = [[_model_cost(one, other, aligned) for other in patterns_b] for one in patterns_a]
    return float(np.sqrt(emd(np.array(costs))))


def clustering_w2(a: FilterClusters, b: FilterClusters, *, aligned: bool = True) -> float:
    """The distance of two clusterings of filters: root of the mean squared W2 distance of their clusters.

    Args:
        aligned: match clusters by assignment, so that their order does not matter; otherwise the first is compared with
            the first and so on.

    Raises:
        SegarError: filters have different sizes, or there are not as many clusters.
    """
    if a.count != b.count:
        raise SegarError(f"clusterings of {a.count} and {b.count} clusters cannot be compared")
    costs = cluster_costs(a, b)
    rows, columns = scipy.optimize.linear_sum_assignment(costs) if aligned else (np.arange(a.count),) * 2
    return float(np.sqrt(costs[rows, columns].mean()))


def visual_distance(
    a: TextureSet | str,
    b: TextureSet | str,
    *,
    rng: np.random.Generator,
    samples: int = 1000,
    embedding: str | Embedding = "pixels",
    laws: Laws = UNIFORM,
    resamples: int = 30,
) -> VisualDistance:
    """Distances of what two renderers make of the same things, in a feature space; all are 0 for a renderer and itself.

    Both show the same things with the same noise, each through a model of its own that is drawn uniformly. What is
    compared are squares of at least 8 x 8 pixels, as uint8.

    Args:
        a, b: sets of textures, or names of shipped ones.
        rng: draws things, noise, models, floors and the bootstrap's ``resamples`` (at least 10).
        samples: how many things, from the product of marginals; at least 10.
        embedding: ``"pixels"``: the pixels from 0 to 1, scaled so that distances are root mean squares of differences;
            ``"filters"``: mean and standard deviation over the square of what 64 fixed random filters of 5 x 5 pixels
            give after a rectifier, which sees patterns wherever they lie; or a function of uint8 ``[n, s, s, 3]`` to
            ``[n, d]``.
        laws: the marginals.

    Raises:
        SegarError: there are no such textures or embedding, no distribution for an input, or too few samples.
    """
    a, b = _textures(a), _textures(b)
    checks.require_count("visual_distance", "samples", samples, 10)
    checks.require_count("visual_distance", "resamples", resamples, 10)
    embed = _embedding(embedding)
    names = tuple(dict.fromkeys((*a.inputs, *b.inputs)))
    size = max(a.period, b.period, SMALLEST_PATCH)

    def draw() -> tuple[np.ndarray, np.ndarray]:
        return product_of_marginals(names, samples, rng, laws), rng.random(samples)

    def shown(textures: TextureSet, things: tuple[np.ndarray, np.ndarray]) -> np.ndarray:
        return embed(_squares(textures, names, *things, size))

    things = draw()
    noise = np.array([is_noise(name) for name in names])
    x, y = shown(a, things), shown(b, things)
    both = np.concatenate([x, y])
    bandwidth = median_distance(np.sqrt(_squares_of(both, both)))
    floors = []
    for _ in range(FLOORS):
        again = draw()
        other = np.where(noise, again[0], things[0]), again[1]
        for textures, first in ((a, x), (b, y)):
            second = shown(textures, again)
            repeated = _paired(first, shown(textures, other))
            floors.append([repeated, _frechet(first, second), _mmd(_kernels(first, second, bandwidth))])
    floor = np.mean(floors, axis=0)
    rows = rng.integers(samples, size=(resamples, samples))
    kernels = _kernels(x, y, bandwidth)
    errors = np.std([[_paired(x[r], y[r]), _frechet(x[r], y[r]), _mmd(kernels, r)] for r in rows], axis=0, ddof=1)
    found = _paired(x, y), _frechet(x, y), _mmd(kernels)
    return VisualDistance(
        embedding if isinstance(embedding, str) else getattr(embedding, "__name__", "given"),
        samples,
        *(Measured(*map(float, numbers)) for numbers in zip(found, floor, errors, strict=True)),
    )


def _textures(given: TextureSet | str) -> TextureSet:
    return given if isinstance(given, TextureSet) else TextureSet.load(given)


def _patterns(textures: TextureSet, names: Sequence[str], period: int, laws: Laws) -> np.ndarray:
    """Mean and, per standard deviation, each input's part of the texture before the squash: ``[model, 1 + input, pixel]``.

    Squared distances between these are means over pixels.
    """
    require_laws(names, laws)
    mean, spread = np.zeros(len(names)), np.ones(len(names))
    for i, name in enumerate(names):
        if name in laws:
            mean[i], spread[i] = laws[name].mean, np.sqrt(laws[name].var)
        elif is_noise(name):
            spread[i] = np.sqrt(GaussianNoise(0.0, 1.0, clip=(-NOISE_CLIP, NOISE_CLIP)).var)
    found = np.zeros((len(textures), 1 + len(names), *textures.bias.shape[1:]))
    found[:, 0] = textures.bias
    for i, name in enumerate(textures.inputs):
        place = names.index(name)
        weights = textures.weights[:, i] * textures.scale[i]
        found[:, 0] += weights * (mean[place] - textures.shift[i])
        found[:, 1 + place] = weights * spread[place]
    repeats = period // textures.period
    tiled = np.tile(found, (1, 1, repeats, repeats, 1)).reshape(*found.shape[:2], -1)
    return tiled / np.sqrt(tiled.shape[-1])


def _model_cost(a: np.ndarray, b: np.ndarray, aligned: bool) -> float:
    """Squared distance of two models, from :func:`_patterns` of each."""
    if not aligned:
        return float(((a - b) ** 2).sum())
    costs = scipy.spatial.distance.cdist(a[1:], b[1:], "sqeuclidean")
    rows, columns = scipy.optimize.linear_sum_assignment(costs)
    return float(((a[0] - b[0]) ** 2).sum() + costs[rows, columns].sum())


def _squares(
    textures: TextureSet, names: Sequence[str], values: np.ndarray, choice: np.ndarray, size: int
) -> np.ndarray:
    """Squares of the textures of things, uint8 ``[thing, size, size, 3]``.

    Args:
        values: of inputs ``names``, float64 ``[thing, name]``.
        choice: which model shows each thing, in [0, 1).
    """
    own = values[:, [names.index(name) for name in textures.inputs]]
    models = (choice * len(textures)).astype(np.int64)
    repeats = -(-size // textures.period)
    return np.tile(textures.patches(textures.features(own), models), (1, repeats, repeats, 1))[:, :size, :size]


def _embedding(given: str | Embedding) -> Embedding:
    known = {"pixels": _pixels, "filters": _random_filters}
    if callable(given):
        return given
    if given not in known:
        raise SegarError(f"there is no embedding '{given}'.{did_you_mean(str(given), known)}")
    return known[given]


def _pixels(squares: np.ndarray) -> np.ndarray:
    flat = squares.reshape(len(squares), -1) / 255.0
    return flat / np.sqrt(flat.shape[1])


def _random_filters(squares: np.ndarray) -> np.ndarray:
    rng = np.random.default_rng(RANDOM_FILTER_SEED)
    filters = rng.standard_normal((RANDOM_FILTER_SIZE**2 * 3, RANDOM_FILTERS))
    filters /= np.sqrt((filters**2).sum(axis=0))
    windows = np.lib.stride_tricks.sliding_window_view(squares / 255.0, (RANDOM_FILTER_SIZE,) * 2, axis=(1, 2))
    places = windows.reshape(len(squares), -1, len(filters))
    responses = np.maximum(places @ filters, 0.0)
    return np.concatenate([responses.mean(axis=1), responses.std(axis=1)], axis=1) / np.sqrt(2 * RANDOM_FILTERS)


def _paired(x: np.ndarray, y: np.ndarray) -> float:
    return float(np.sqrt(((x - y) ** 2).sum(axis=1).mean()))


def _frechet(x: np.ndarray, y: np.ndarray) -> float:
    """Root of |m - m'|^2 + tr(C + C' - 2 (C C')^(1/2)) (Dowson and Landau 1982).

    The trace of (C C')^(1/2) is the sum of the singular values of the product of the symmetric roots.
    """
    means = x.mean(axis=0), y.mean(axis=0)
    first, second = (_root(np.atleast_2d(np.cov(points, rowvar=False))) for points in (x, y))
    overlap = np.linalg.svd(first @ second, compute_uv=False).sum()
    square = ((means[0] - means[1]) ** 2).sum() + (first**2).sum() + (second**2).sum() - 2 * overlap
    return float(np.sqrt(max(square, 0.0)))


def _root(covariance: np.ndarray) -> np.ndarray:
    """The symmetric root of a covariance; the squares of its entries sum to the trace."""
    values, vectors = np.linalg.eigh(covariance)
    return (vectors * np.sqrt(np.maximum(values, 0.0))) @ vectors.T


def _kernels(x: np.ndarray, y: np.ndarray, bandwidth: float) -> np.ndarray:
    """k(x, x') + k(y, y') - k(x, y') - k(x', y), float64 ``[sample, sample]``."""
    own, other, between = (np.exp(-0.5 * _squares_of(*pair) / bandwidth**2) for pair in ((x, x), (y, y), (x, y)))
    return own + other - between - between.T


def _mmd(kernels: np.ndarray, rows: np.ndarray | None = None) -> float:
    """Root of the mean (biased estimate, Gretton et al. 2012), of some samples if ``rows`` are given."""
    counts = np.ones(len(kernels)) if rows is None else np.bincount(rows, minlength=len(kernels))
    return float(np.sqrt(max(counts @ kernels @ counts, 0.0)) / len(kernels))


def _squares_of(x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """Squared distances by a matrix product, float64 ``[n, m]``: right to 1e-15 of the squared norms."""
    return np.maximum((x**2).sum(axis=1)[:, None] + (y**2).sum(axis=1) - 2 * (x @ y.T), 0.0)
