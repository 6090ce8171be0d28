"""How well a level set represents its distribution: coverage, and the effective number of levels."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from segar.errors import LevelError
from segar.language import Factor
from segar.levels import LevelDistribution, Levels, checks, entity_types
from segar.metrics.points import Spread, Units
from segar.metrics.wasserstein import MISMATCH, exact_costs

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
        checks.require_count("coverage", "levels as sample", sample, 1)
        of = of.sample(sample, seed=int(rng.integers(2**62)), split=STAND_IN_SPLIT)
    units = Units.checked("coverage", (levels, of), scale, factors)
    costs = exact_costs(of, levels, entity_types(of, levels), units, mismatch)
    nearest = np.sqrt(costs.min(axis=1))
    return Coverage(float(nearest.max()), float(np.quantile(nearest, 0.95)), float(nearest.mean()))


def effective_number(
    levels: Levels,
    *,
    order: float = 1.0,
    mismatch: float = MISMATCH,
    scale: Spread | None = None,
    factors: Sequence[type[Factor]] | None = None,
) -> float:
    """How many levels without any similarity the set is worth, from 1 (all equal) to its length (all unlike).

    The diversity of Leinster and Cobbold (2012) for equal weights, (mean_i z_i^(order - 1))^(1 / (1 - order)), where z_i is
    the mean similarity exp(-d) of level i to all levels, itself included, and d the exact distance in standard
    deviations. Order 1 (the limit, exp(-mean log z)) weighs all levels alike, order 2 crowds, order 0 outliers.

    Args:
        order: at least 0, finite.
        Others as for :func:`segar.metrics.w2`.

    Raises:
        LevelError: not a level set, or a negative order.
    """
    units = Units.checked("effective_number", (levels,), scale, factors)
    if not 0 <= order < np.inf:
        raise LevelError(f"effective_number: the order must be a finite number of at least 0, not {order!r}")
    costs = exact_costs(levels, levels, entity_types(levels), units, mismatch)
    typical = np.exp(-np.sqrt(np.maximum(costs, 0.0))).mean(axis=1)
    if order == 1.0:
        return float(np.exp(-np.log(typical).mean()))
    return float(np.mean(typical ** (order - 1)) ** (1 / (1 - order)))
