"""The sets of textures from our own bank of filters: a baseline, and variants that are close to it and far from it."""

from dataclasses import dataclass
from functools import cache

import numpy as np

from experiments.textures.linear_autoencoder import untrained
from experiments.textures.texture_bars import shortfalls
from segar.language import Object
from segar.metrics import visual_distance, visual_w2
from segar.textures import (
    CHIEF,
    INPUTS,
    KINDS,
    FilterBank,
    FilterClusters,
    TextureSet,
    aligned,
    cluster_filters,
    filter_patterns,
    filter_weights,
    looks,
    texture_set,
)

ASSOCIATIONS = 2000  # ways to deal clusters to inputs that are tried for the baseline
BASELINES = range(60)
VARIANTS = range(1000, 1300)
LEAST_REDRAWN = 0.15  # share of the bank; with less, variants equal the baseline
MODELS = 5  # in each set of variants
# What makes a difference, as root mean squares over pixels and of the mean colour, where black is -1 and white 1.
TEXTURE_CONTRAST, COLOUR_CONTRAST = 0.4, 0.2
FLOOR = 0  # comes first among the looks
FAR_SEEN = 2.9  # times what noise does
LIKENESS = 1.3  # of things among each other, at most so many times the baseline's


@dataclass(frozen=True)
class Variant:
    """A model by its seed: its weights, its distance from the baseline, and how alike its things are."""

    seed: int
    weights: np.ndarray
    distance: float
    likeness: float


@cache
def filter_sets() -> dict[str, TextureSet]:
    """The sets ``baseline``, ``close`` and ``far``; the same at every call.

    The baseline is the one of its seeds whose things differ most clearly, each with the best of many ways to deal clusters
    to inputs. In a variant a random share of the bank is drawn anew and clustered; if its seed is odd, k-means starts
    elsewhere, and cells look for other filters. Its clusters are aligned to the baseline's. Of all variants that meet
    the bars of :mod:`experiments.textures.texture_bars` and whose things differ, those nearest to the baseline by ``visual_w2``
    are close, and the farthest are far, if what is seen through filters that fix no place is far from it, too.
    """
    candidates = sorted((baseline_candidate(seed) for seed in BASELINES), key=lambda found: found[0].likeness)
    chosen, clusters = next(found for found in candidates if _is_good(found[0].weights))
    baseline = texture_set("baseline", [chosen.weights], seeds=[chosen.seed], bank="gabor")
    variants = [variant(seed, chosen.seed, clusters, baseline) for seed in VARIANTS]
    by_distance = sorted(variants, key=lambda one: one.distance)
    sets = {"baseline": baseline}
    for name, order in (("close", by_distance), ("far", by_distance[::-1])):
        seen = FAR_SEEN if name == "far" else 0.0
        taken = _first_good(order, LIKENESS * chosen.likeness, baseline, seen)
        sets[name] = texture_set(
            name,
            [one.weights for one in taken],
            bank="gabor",
            seeds=[one.seed for one in taken],
            distances=[round(one.distance, 4) for one in taken],
            candidates=len(VARIANTS),
        )
    return sets


def baseline_candidate(seed: int) -> tuple[Variant, FilterClusters]:
    """A model of a bank of its own, and its clusters in the order of the inputs."""
    rng = np.random.default_rng(seed)
    clusters = cluster_filters(FilterBank.built_in(rng), len(INPUTS), rng)
    patterns = filter_patterns(clusters, np.random.default_rng(seed))
    orders = [rng.permutation(len(INPUTS)) for _ in range(ASSOCIATIONS)]
    best = min(orders, key=lambda order: likeness(filter_weights(patterns[order])))
    weights = filter_weights(patterns[best])
    return Variant(seed, weights, 0.0, likeness(weights)), clusters.reordered(best)


def variant(seed: int, bank_seed: int, clusters: FilterClusters, baseline: TextureSet) -> Variant:
    """A model whose clusters are aligned to those of the baseline."""
    rng = np.random.default_rng(seed)
    kept, fresh = FilterBank.built_in(np.random.default_rng(bank_seed)).filters, FilterBank.built_in(rng).filters
    redrawn = rng.random(len(kept)) < rng.uniform(LEAST_REDRAWN, 1.0)
    bank = FilterBank("gabor", np.where(redrawn[:, None, None, None], fresh, kept))
    like = seed % 2 == 0
    own = aligned(cluster_filters(bank, len(INPUTS), rng, clusters if like else None), clusters)
    weights = filter_weights(filter_patterns(own, np.random.default_rng(bank_seed) if like else rng))
    return Variant(seed, weights, visual_w2(baseline, texture_set("variant", [weights])), likeness(weights))


def likeness(weights: np.ndarray) -> float:
    """How much alike the floor and kinds of things are under a model: a sum over pairs, least where all differ clearly."""
    textures = np.tanh(np.tensordot(_kinds(), weights, axes=1))
    first, second = np.triu_indices(len(textures), 1)
    difference = textures[first] - textures[second]
    whole = (difference**2).mean(axis=(1, 2, 3))
    colour = (difference.mean(axis=(1, 2)) ** 2).mean(axis=1)
    # What lies on the floor must stand out, and so must the ball and the goal. And what makes objects unlike tiles makes
    # them like each other, so it must not win by the number of such pairs.
    is_object, is_chief = (np.array([False, *(isinstance(k, types) for k in KINDS)]) for types in (Object, CHIEF))
    on_floor, chief = first == FLOOR, is_chief[first] | is_chief[second]
    clear = np.where(on_floor, 4.0, np.where(chief, 2.0, 1.0))
    alike = np.exp(-whole / (clear * TEXTURE_CONTRAST**2)) + np.exp(-colour / (clear * COLOUR_CONTRAST**2))
    return float(alike @ np.where(on_floor | chief | (is_object[first] & is_object[second]), 4.0, 1.0))


@cache
def _kinds() -> np.ndarray:
    return looks(untrained(), KINDS)


def _first_good(order: list[Variant], most_alike: float, baseline: TextureSet, least_seen: float) -> list[Variant]:
    """The first variants that meet the bars, whose things differ, and that are seen to differ so much from the baseline."""
    taken: list[Variant] = []
    for one in order:
        if one.likeness > most_alike or not _is_good(one.weights) or _seen(one, baseline) < least_seen:
            continue
        taken.append(one)
        if len(taken) == MODELS:
            return taken
    raise ValueError(f"only {len(taken)} of {len(order)} variants can be read and told apart; raise VARIANTS")


def _seen(one: Variant, baseline: TextureSet) -> float:
    """How far the same things seen through filters are from how the baseline shows them, in units of what noise does."""
    seen = visual_distance(
        baseline,
        texture_set("candidate", [one.weights]),
        rng=np.random.default_rng(0),
        samples=300,
        embedding="filters",
        resamples=10,
    )
    return seen.paired.value / seen.paired.floor


def _is_good(weights: np.ndarray) -> bool:
    """Whether a model meets the bars."""
    return not shortfalls(texture_set("candidate", [weights]))
