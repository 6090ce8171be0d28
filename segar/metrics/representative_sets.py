"""How well a level set represents its distribution: distance, coverage, and the effective number of levels."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from segar.errors import LevelError
from segar.language import Factor
from segar.levels import LevelDistribution, Levels, checks, entity_types
from segar.metrics.kolmogorov import FactorKS, ks_report
from segar.metrics.points import Spread, Units, spread
from segar.metrics.wasserstein import MISMATCH, exact_costs
from segar.support import emd

STAND_IN_LEVELS = 500  # levels that stand for the distribution
STAND_IN_SPLIT = "representativeness"
"""Split of these levels, so that they are no train or test levels."""


@dataclass(frozen=True)
class Representativeness:
    """How a level set compares with independent sets of its size from the same distribution.

    Attributes:
        distance: exact W2 from the set to 500 levels of the distribution.
        expected, expected_std: mean and standard deviation of that distance for independent sets.
        farther: share of independent sets that are at least as far (the set itself counted in): small for a set that is
            less representative than chance, near 1 for one that covers better than chance.
        ks, ks_p_value: mean-field statistic of the set against the distributions of its factors, and its test.
        factors: the marginals, most conspicuous first; see :class:`segar.metrics.FactorKS`.
    """

    distance: float
    expected: float
    expected_std: float
    farther: float
    ks: float
    ks_p_value: float
    factors: tuple[FactorKS, ...]


@dataclass(frozen=True)
class Coverage:
    """Distances from levels of the distribution (or of another set) to the nearest level of a set.

    Attributes:
        radius: the largest: every level is within it of some level of the set.
        high: their 95 % quantile. mean: their mean.
    """

    radius: float
    high: float
    mean: float


def representativeness(
    levels: Levels,
    law: LevelDistribution,
    *,
    rng: np.random.Generator,
    resamples: int = 99,
    factors: Sequence[type[Factor]] | None = None,
) -> Representativeness:
    """Whether a set of levels is a fair sample of a distribution, without any training.

    Args:
        rng: seeds the levels that stand for the distribution, and ``resamples`` (at least 19) independent sets.
        factors: count these factors and no others.

    Raises:
        LevelError: as :func:`segar.metrics.ks_report`.
    """
    checks.require_levels("representativeness", levels)
    checks.require_distribution("representativeness", law)
    report = ks_report(levels, law, rng=rng, resamples=resamples, factors=factors)
    n = len(levels)
    stand_in = law.sample(STAND_IN_LEVELS, seed=int(rng.integers(2**62)), split=STAND_IN_SPLIT)
    fresh = law.sample(n * resamples, seed=int(rng.integers(2**62)), split=STAND_IN_SPLIT)
    units, types = Units(spread(law), factors), entity_types(levels, stand_in, fresh)
    sets = [levels, *(fresh[k * n : (k + 1) * n] for k in range(resamples))]
    costs = (exact_costs(one, stand_in, types, units, MISMATCH) for one in sets)
    distances = np.sqrt([emd(cost) for cost in costs])
    return Representativeness(
        distance=float(distances[0]),
        expected=float(distances[1:].mean()),
        expected_std=float(distances[1:].std(ddof=1)),
        farther=float((distances >= distances[0] - 1e-12).mean()),
        ks=report.value,
        ks_p_value=report.p_value,
        factors=report.factors,
    )


def coverage(
    levels: Levels,
    of: Levels | LevelDistribution,
    *,
    rng: np.random.Generator | None = None,
    sample: int = 2000,
    mismatch: float = MISMATCH,
    scale: Spread | None = None,
    factors: Sequence[type[Factor]] | None = None,
) -> Coverage:
    """How far the levels of a distribution, or of another set, are from the nearest of ``levels``, in exact distance.

    Args:
        of: the other set, or a distribution, for which ``sample`` levels stand whose seed ``rng`` draws. So the radius is
            that of these levels; with more of them it grows, slowly.
        Others as for :func:`segar.metrics.w2`.

    Raises:
        LevelError: not a level set, or a distribution without ``rng``.
    """
    if not isinstance(of, Levels):
        if rng is None:
            raise LevelError("coverage of a distribution draws levels from it: coverage(levels, distribution, rng=...)")
        checks.require_distribution("coverage", of)
        checks.require_generator("coverage", rng)
        of = of.sample(sample, seed=int(rng.integers(2**62)), split=STAND_IN_SPLIT)
    units = Units.checked("coverage", (levels, of), scale, factors)
    costs = exact_costs(of, levels, entity_types(of, levels), units, mismatch)
    nearest = np.sqrt(costs.min(axis=1))
    return Coverage(float(nearest.max()), float(np.quantile(nearest, 0.95)), float(nearest.mean()))


def effective_number(
    levels: Levels,
    *,
    mismatch: float = MISMATCH,
    scale: Spread | None = None,
    factors: Sequence[type[Factor]] | None = None,
) -> float:
    """How many levels without any similarity the set is worth, from 1 (all equal) to its length (all unlike).

    The diversity of order 1 of Leinster and Cobbold (2012) for equal weights, exp(-mean_i log z_i), where z_i is the mean
    similarity exp(-d) of level i to all levels, itself included, and d the exact distance in standard deviations.

    Args: as for :func:`segar.metrics.w2`.

    Raises:
        LevelError: not a level set.
    """
    units = Units.checked("effective_number", (levels,), scale, factors)
    costs = exact_costs(levels, levels, entity_types(levels), units, mismatch)
    typical = np.exp(-np.sqrt(np.maximum(costs, 0.0))).mean(axis=1)
    return float(np.exp(-np.log(typical).mean()))
