"""The sliced Wasserstein-2 distance, for many levels."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from segar.language import Factor
from segar.levels import Levels, checks
from segar.metrics.level_vectors import embed, frames
from segar.metrics.points import Spread
from segar.metrics.transport import quantile_steps
from segar.metrics.unseen import warn_of_unseen
from segar.metrics.wasserstein import MISMATCH

PROJECTIONS = 500


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
