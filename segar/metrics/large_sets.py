"""Wasserstein-2 distances of many levels: sliced, and with an entropic term."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import scipy

from segar.errors import LevelError, SegarError
from segar.language import Factor
from segar.levels import Levels, require_generator, require_levels
from segar.metrics.embedding import embed, frames
from segar.metrics.points import Spread
from segar.metrics.wasserstein import MISMATCH, Mode, cost_function
from segar.support import pot

SAFE_EXPONENT = 500.0  # exp(-500) is a float64 above 0: below, the kernel exp(-C / eps) may be used as it is
SINKHORN_ITERATIONS = 20_000
SINKHORN_ERROR = 1e-6  # of the marginals; the cost is then right to about as many digits


@dataclass(frozen=True)
class SlicedW2:
    """A sliced distance; ``standard_error`` is that of having drawn so many ``projections`` and no more."""

    value: float
    standard_error: float
    projections: int


@dataclass(frozen=True)
class EntropicW2:
    """An entropic distance.

    Attributes:
        value: root of the Sinkhorn divergence OT_e(a, b) - OT_e(a, a) / 2 - OT_e(b, b) / 2.
        transport: root of the cost <G, C> of the entropic plan between a and b; at least :func:`segar.metrics.w2`.
        regularisation: e, in the unit of the squared distance.
    """

    value: float
    transport: float
    regularisation: float


def w2_sliced(
    a: Levels,
    b: Levels,
    *,
    rng: np.random.Generator,
    projections: int = 500,
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
        rng: draws the directions; ``projections`` (at least 2) of them, or a few more to fill orthonormal frames.
        mismatch, scale, factors: as for :func:`segar.metrics.w2`.

    Raises:
        LevelError: not two level sets, or fewer than 2 projections.

    Source: Bonneel et al. 2015.
    """
    require_levels("w2_sliced", a, b)
    require_generator("w2_sliced", rng)
    if projections < 2:
        raise LevelError(f"w2_sliced needs at least 2 projections, not {projections}")
    x, y = embed(a, b, scale=scale, mismatch=mismatch, factors=factors)
    dimension = x.shape[1]
    if dimension == 0:
        return SlicedW2(0.0, 0.0, 0)
    directions = frames(dimension, projections, rng)
    squares = dimension * np.asarray(pot().wasserstein_1d(x @ directions, y @ directions, p=2))
    value = float(np.sqrt(squares.mean()))
    error = float(squares.std(ddof=1) / np.sqrt(len(squares))) if len(squares) > 1 else 0.0
    return SlicedW2(value, error / (2 * value) if value > 0 else 0.0, len(squares))


def w2_entropic(
    a: Levels,
    b: Levels,
    mode: Mode = "exact",
    *,
    regularisation: float = 0.05,
    mismatch: float | None = None,
    scale: Spread | None = None,
    factors: Sequence[type[Factor]] | None = None,
) -> EntropicW2:
    """The Wasserstein-2 distance with an entropic term, OT_e = min over plans G of <G, C> + e KL(G | a x b), by Sinkhorn.

    The divergence is 0 for equal sets, goes to the exact squared distance as e goes to 0, and is less biased by having
    few levels than that (Genevay et al. 2019, Feydy et al. 2019).

    Args:
        regularisation: e as a share of the mean of C between a and b.
        Others as for :func:`segar.metrics.w2`, whose modes say what C is.

    Raises:
        LevelError: as :func:`w2`, or the regularisation is not positive.
        SegarError: Sinkhorn's algorithm did not converge; the regularisation is too small.
    """
    if not 0 < regularisation < np.inf:
        raise LevelError(f"w2_entropic: the regularisation must be a positive number, not {regularisation!r}")
    cost = cost_function("w2_entropic", a, b, mode, mismatch, scale, factors)
    between = cost(a, b)
    epsilon = regularisation * float(between.mean())
    if epsilon == 0.0:
        return EntropicW2(0.0, 0.0, 0.0)
    plan = _sinkhorn(between, epsilon)
    transport = float((plan * between).sum())
    square = _objective(plan, between, epsilon)
    for own in (cost(a, a), cost(b, b)):
        square -= 0.5 * _objective(_sinkhorn(own, epsilon), own, epsilon)
    return EntropicW2(float(np.sqrt(max(square, 0.0))), float(np.sqrt(transport)), epsilon)


def _sinkhorn(cost: np.ndarray, epsilon: float) -> np.ndarray:
    """The entropic plan between uniform weights, float64 ``[n, m]``."""
    n, m = cost.shape
    method = "sinkhorn" if cost.max() / epsilon < SAFE_EXPONENT else "sinkhorn_log"
    plan, log = pot().sinkhorn(
        np.full(n, 1 / n),
        np.full(m, 1 / m),
        cost,
        epsilon,
        method=method,
        numItermax=SINKHORN_ITERATIONS,
        stopThr=SINKHORN_ERROR,
        log=True,
        warn=False,
    )
    if not np.isfinite(plan).all() or log["err"][-1] > SINKHORN_ERROR:
        raise SegarError(
            f"entropic transport of {n} x {m} levels did not converge in {SINKHORN_ITERATIONS} iterations; take a larger"
            " regularisation"
        )
    return plan


def _objective(plan: np.ndarray, cost: np.ndarray, epsilon: float) -> float:
    """<G, C> + e KL(G | product of uniform weights)."""
    n, m = cost.shape
    return float((plan * cost).sum() + epsilon * scipy.special.rel_entr(plan, 1 / (n * m)).sum())
