"""The paper's second renderer: filters of an image network, clustered, one cluster for each factor.

The filters of a bank, each of norm 1, are clustered by k-means into as many clusters as there are inputs. What an input
looks like is pieced together from the filters of its cluster.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np
import scipy

from segar.errors import SegarError
from segar.support import emd
from segar.textures.filter_bank import FilterBank
from segar.textures.inputs import BACKGROUND, NOISE, is_noise
from segar.textures.standard import INPUTS, UNIFORM, Laws, units
from segar.textures.texture_sets import TextureSet

KMEANS_ITERATIONS = 50
KMEANS_STARTS = 20
CELLS = 2  # the period is so many cells wide
LARGEST_CELL = 4  # [pixels] so that a period is not larger than the smallest things in a picture of 64 pixels
# Root mean square of what one standard deviation of an input adds before tanh. More is easier to see, less is easier to
# read out. The floor is nothing else; what is rare or tells things apart may be strong.
AMPLITUDE = 0.32
AMPLITUDES = {BACKGROUND: 1.2, "Charge": 0.48, "Magnetism": 0.48, "StoredEnergy": 0.48, "Alive": 0.25, NOISE: 0.25}
AMPLITUDES |= {"Consumes": 0.35, "GoalTile": 0.46, "GolfBall": 0.46}


def filter_textures(
    name: str,
    bank: FilterBank,
    seeds: Iterable[int] = (0,),
    *,
    inputs: Sequence[str] = INPUTS,
    laws: Laws = UNIFORM,
) -> TextureSet:
    """Textures from a bank of filters, a model per seed.

    A seed chooses the start of k-means, which cluster belongs to which input, and which filters stand for a cluster. The
    clusters of the second and later models are aligned to the first model's.

    Args:
        inputs, laws: what is shown, and the distributions that say how much each input varies.

    Raises:
        SegarError: there are too few filters for the inputs, or no distribution for an input.
    """
    patterns, first, seeds = [], None, tuple(seeds)
    for seed in seeds:
        rng = np.random.default_rng(seed)
        clusters = cluster_filters(bank, len(inputs), rng)
        clusters = clusters if first is None else aligned(clusters, first)
        first = first or clusters
        patterns.append(filter_patterns(clusters, rng))
    kinds = [NOISE if is_noise(name) else name for name in inputs]
    amplitudes = np.array([AMPLITUDES.get(kind, AMPLITUDE) for kind in kinds])[:, None, None, None]
    weights = np.stack(patterns) * amplitudes
    bias = np.zeros((len(weights), *weights.shape[2:]))
    origin = {"renderer": "filters", "bank": bank.name, "filters": len(bank), "seeds": list(seeds)}
    return TextureSet(name, tuple(inputs), weights, bias, *units(inputs, laws), origin=origin)


@dataclass(frozen=True, eq=False)
class FilterClusters:
    """A bank dealt into clusters, the first for the first input and so on.

    Attributes:
        filters: normalised, float64 ``[filter, k, k, 3]``.
        labels: int64 ``[filter]``, the cluster of each.
        count: how many clusters.
    """

    filters: np.ndarray
    labels: np.ndarray
    count: int

    def members(self, cluster: int) -> np.ndarray:
        """The filters of a cluster, float64 ``[filter, k, k, 3]``."""
        return self.filters[self.labels == cluster]

    def reordered(self, order: Sequence[int] | np.ndarray) -> FilterClusters:
        """The same clusters, the first of which is now number ``order[0]`` and so on."""
        place = np.empty(self.count, np.int64)
        place[np.asarray(order)] = np.arange(self.count)
        return FilterClusters(self.filters, place[self.labels], self.count)


def cluster_filters(bank: FilterBank, count: int, rng: np.random.Generator) -> FilterClusters:
    """The bank in ``count`` clusters by k-means, the best of some starts; in random order, as clusters have none.

    Raises:
        SegarError: the bank has fewer filters than clusters, or too many are alike.
    """
    from scipy.cluster.vq import ClusterError, kmeans2

    if len(bank) < count:
        raise SegarError(f"{bank!r} cannot be dealt into {count} clusters; take a larger bank or fewer inputs")
    filters = bank.normalised()
    points = filters.reshape(len(filters), -1)
    best, labels = np.inf, None
    for _ in range(KMEANS_STARTS):
        start = points[rng.choice(len(points), count, replace=False)]
        try:
            centres, found = kmeans2(points, start, iter=KMEANS_ITERATIONS, minit="matrix", missing="raise")
        except ClusterError:  # a cluster lost its last member: another start
            continue
        inertia = float(((points - centres[found]) ** 2).sum())
        if inertia < best and len(np.unique(found)) == count:
            best, labels = inertia, found
    if labels is None:
        raise SegarError(f"{bank!r} cannot be dealt into {count} clusters: too many of its filters are alike")
    return FilterClusters(filters, labels.astype(np.int64), count).reordered(rng.permutation(count))


def cluster_costs(a: FilterClusters, b: FilterClusters) -> np.ndarray:
    """Squared Wasserstein-2 distances between the clusters of a and those of b, as sets of filters, ``[cluster, cluster]``.

    The squared distance of two filters is the mean over their pixels and channels, so that it is 2 for unlike ones.

    Raises:
        SegarError: filters have different sizes.
    """
    if a.filters.shape[1:] != b.filters.shape[1:]:
        raise SegarError(
            f"filters of {a.filters.shape[1]} pixels cannot be compared with filters of {b.filters.shape[1]} pixels"
        )
    per_pixel = a.filters[0].size
    points_a, points_b = (c.filters.reshape(len(c.filters), -1) for c in (a, b))
    between = scipy.spatial.distance.cdist(points_a, points_b, "sqeuclidean") / per_pixel
    return np.array(
        [[emd(between[np.ix_(a.labels == i, b.labels == j)]) for j in range(b.count)] for i in range(a.count)]
    )


def aligned(clusters: FilterClusters, baseline: FilterClusters) -> FilterClusters:
    """The clusters in the order in which they are nearest to as many of ``baseline``, by assignment (the Hungarian method)."""
    _, order = scipy.optimize.linear_sum_assignment(cluster_costs(baseline, clusters))
    return clusters.reordered(order)


def filter_patterns(clusters: FilterClusters, rng: np.random.Generator) -> np.ndarray:
    """What each cluster looks like, float64 ``[cluster, P, P, 3]`` with a root mean square of 1.

    A transposed convolution over 2 x 2 cells, each with one member of the cluster, on a field that repeats. Filters wider
    than a cell overlap. ``rng`` draws what each cell looks for, and the member most like that is taken: where clusters
    change little, so do patterns. But for their mean colours, of which there are only three independent ones, patterns are
    then made orthogonal, changing them as little as possible (Loewdin 1950), so that one factor's can be told from the
    others'.
    """
    size = clusters.filters.shape[1]
    stride = min(size, LARGEST_CELL)
    period = CELLS * stride
    patterns = np.zeros((clusters.count, period, period, 3))
    reach = np.arange(size)
    sought = rng.standard_normal((CELLS**2, *clusters.filters.shape[1:]))
    for cluster in range(clusters.count):
        members = clusters.members(cluster)
        taken = np.tensordot(members, sought, axes=([1, 2, 3], [1, 2, 3])).argmax(axis=0)
        for cell, member in enumerate(taken):
            rows, columns = (reach + stride * (cell // CELLS)) % period, (reach + stride * (cell % CELLS)) % period
            np.add.at(patterns[cluster], np.ix_(rows, columns), members[member])
    patterns /= np.sqrt((patterns**2).mean(axis=(1, 2, 3), keepdims=True))
    colours = patterns.mean(axis=(1, 2), keepdims=True)
    left, _, right = np.linalg.svd((patterns - colours).reshape(clusters.count, -1), full_matrices=False)
    waves = (left @ right).reshape(patterns.shape) * np.sqrt(patterns[0].size)
    return colours + waves * np.sqrt(1.0 - (colours**2).mean(axis=(1, 2, 3), keepdims=True))
