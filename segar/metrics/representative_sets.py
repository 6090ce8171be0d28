"""How well a level set represents its distribution: coverage, and the effective number of levels."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from segar.errors import LevelError
from segar.language import Factor
from segar.levels import LevelDistribution, Levels, checks, entity_types
from segar.metrics.points import Spread, Units
from segar.metrics.wasserstein import MISMATCH, exact_costs

STAND_IN = 2000  # levels that stand for a distribution
STAND_IN_SPLIT = "representativeness"
"""Split of these levels, so that they are no train or test levels."""


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


def coverage(
    levels: Levels,
    of: Levels | LevelDistribution,
    *,
    rng: np.random.Generator | None = None,
    mismatch: float = MISMATCH,
    scale: Spread | None = None,
    factors: Sequence[type[Factor]] | None = None,
) -> Coverage:
    """How far the levels of a distribution, or of another set, are from the nearest of ``levels``, in exact distance.

    Args:
        of: the other set, or a distribution, for which 2,000 levels stand whose seed ``rng`` draws. So the radius is
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
        of = of.sample(STAND_IN, seed=int(rng.integers(2**62)), split=STAND_IN_SPLIT)
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
    Arguments and errors are those of :func:`segar.metrics.w2`.
    """
    units = Units.checked("effective_number", (levels,), scale, factors)
    costs = exact_costs(levels, levels, entity_types(levels), units, mismatch)
    typical = np.exp(-np.sqrt(np.maximum(costs, 0.0))).mean(axis=1)
    return float(np.exp(-np.log(typical).mean()))
