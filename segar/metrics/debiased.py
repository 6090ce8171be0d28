"""The part of a Wasserstein-2 distance that comes from having few levels, and the distance without it."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from segar.errors import LevelError
from segar.language import Factor
from segar.levels import LevelDistribution, Levels, require_distribution, require_generator, require_levels
from segar.metrics.points import Spread, spread
from segar.metrics.wasserstein import Mode, cost_function, w2
from segar.support import emd

FRESH_SPLIT = "same-distribution floor"
"""Split of the levels that stand for a distribution here, so that they are no train or test levels."""


@dataclass(frozen=True)
class Floor:
    """Distances of independent level sets of one distribution; ``mean`` and ``std`` over ``repeats`` of them."""

    mean: float
    std: float
    repeats: int


@dataclass(frozen=True)
class DebiasedW2:
    """A distance without what having few levels adds to it.

    Attributes:
        value: the distance, as :func:`segar.metrics.w2` returns it.
        floor_a, floor_b: of two sets of the same sizes of a's distribution, and of b's.
        square: value^2 - (E floor_a^2 + E floor_b^2) / 2; around 0 for one distribution, and negative about as often as
            positive.
        standard_error: of ``square``, from the floors' repetitions and from those of the distance between fresh sets.
        debiased: the root of ``square``, 0 where that is negative.
    """

    value: float
    floor_a: Floor
    floor_b: Floor
    square: float
    standard_error: float
    debiased: float


def same_distribution_floor(
    law: LevelDistribution,
    n: int,
    m: int,
    mode: Mode = "exact",
    *,
    rng: np.random.Generator,
    repeats: int = 10,
    mismatch: float | None = None,
    scale: Spread | None = None,
    factors: Sequence[type[Factor]] | None = None,
) -> Floor:
    """The distance that n levels have from m others of their own distribution.

    With large m it is W2(n, infinity): how far n levels are from the distribution that they come from.

    Args:
        rng: seeds the fresh levels; ``repeats`` (at least 2) pairs of sets are drawn.
        Others as for :func:`segar.metrics.w2`.

    Raises:
        LevelError: as :func:`segar.metrics.w2`, or too few repeats.
    """
    require_distribution("same_distribution_floor", law)
    require_generator("same_distribution_floor", rng)
    options = {"mode": mode, "mismatch": mismatch, "scale": scale, "factors": factors}
    return _floor(_distances((law, n), (law, m), rng, repeats, options))


def w2_debiased(
    a: Levels,
    b: Levels,
    mode: Mode = "exact",
    *,
    rng: np.random.Generator,
    repeats: int = 10,
    mismatch: float | None = None,
    scale: Spread | None = None,
    factors: Sequence[type[Factor]] | None = None,
) -> DebiasedW2:
    """The distance with its floors, and without them: W2^2(a, b) - (W2^2(a', a'') + W2^2(b', b'')) / 2.

    a', a'' are fresh sets of a's distribution with as many levels as a and b, likewise b', b''. This is for levels that
    were drawn independently from their distributions; a set that was selected (:func:`segar.design`) has no such floor.
    Arguments as for :func:`same_distribution_floor`. The subtraction is that of the energy distance and of the Sinkhorn
    divergence (Genevay, Peyré and Cuturi 2018), applied to squared distances.

    Raises:
        LevelError: as :func:`segar.metrics.w2`; or levels do not know their distribution, as those from files.
    """
    require_levels("w2_debiased", a, b)
    require_generator("w2_debiased", rng)
    for levels in (a, b):
        if levels.distribution is None:
            raise LevelError(
                f"w2_debiased draws fresh levels, and {levels!r} do not know their distribution (a level file holds"
                " none). Sample them from it again, or see w2_report, whose floor deals the given levels anew"
            )
    unit = (spread(a, b) if scale is None else scale) if mode == "exact" else None
    options = {"mode": mode, "mismatch": mismatch, "scale": unit, "factors": factors}
    value = float(np.sqrt(emd(cost_function("w2_debiased", a, b, **options)(a, b))))
    of_a, of_b = (require_distribution("w2_debiased", levels.distribution) for levels in (a, b))
    n, m = len(a), len(b)
    pairs = ((of_a, n), (of_a, m)), ((of_b, n), (of_b, m)), ((of_a, n), (of_b, m))
    own_a, own_b, between = (_distances(*pair, rng, repeats, options) for pair in pairs)
    square = value**2 - 0.5 * float((own_a**2).mean() + (own_b**2).mean())
    variances = [float(np.var(d**2, ddof=1)) for d in (own_a, own_b, between)]
    return DebiasedW2(
        value=value,
        floor_a=_floor(own_a),
        floor_b=_floor(own_b),
        square=square,
        standard_error=float(np.sqrt(variances[2] + 0.25 * (variances[0] + variances[1]) / repeats)),
        debiased=float(np.sqrt(max(square, 0.0))),
    )


def _floor(distances: np.ndarray) -> Floor:
    return Floor(float(distances.mean()), float(distances.std(ddof=1)), len(distances))


def _distances(
    first: tuple[LevelDistribution, int],
    second: tuple[LevelDistribution, int],
    rng: np.random.Generator,
    repeats: int,
    options: dict[str, Any],
) -> np.ndarray:
    """Distances of fresh pairs of level sets, float64 ``[repeats]``; each side is (distribution, number of levels).

    ``options`` are those of :func:`segar.metrics.w2`.
    """
    if repeats < 2:
        raise LevelError(f"a floor needs at least 2 repeats, not {repeats}")
    found = []
    for _ in range(repeats):
        a, b = (source.sample(n, seed=int(rng.integers(2**62)), split=FRESH_SPLIT) for source, n in (first, second))
        found.append(w2(a, b, **options))
    return np.array(found)
