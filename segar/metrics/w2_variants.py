"""Wasserstein-2 distances for many levels (sliced, entropic), and such that leave levels behind (unbalanced, partial)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
import scipy

from segar.errors import LevelError, SegarError, did_you_mean
from segar.language import Factor
from segar.levels import Levels, checks
from segar.metrics.level_vectors import embed, frames
from segar.metrics.points import Spread
from segar.metrics.unseen import warn_of_unseen
from segar.metrics.wasserstein import MISMATCH, Mode, cost_function
from segar.support import TRANSPORT_STEPS, plan_of, pot

SAFE_EXPONENT = 500.0  # exp(-500) is a float64 above 0: below, the kernel exp(-C / eps) may be used as it is
SINKHORN_ITERATIONS = 20_000
SINKHORN_ERROR = 1e-6  # of the marginals; the cost is then right to about as many digits
KL_ITERATIONS = 500  # between two looks at the duality gap
KL_ROUNDS = 40
KL_GAP = 1e-3  # share of the objective that may be left to gain


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


@dataclass(frozen=True)
class EntropicW2:
    """An entropic distance.

    Attributes:
        value: root of the Sinkhorn divergence OT_e(a, b) - OT_e(a, a) / 2 - OT_e(b, b) / 2.
        transport: root of the cost <G, C> of the entropic plan between a and b; at least :func:`segar.metrics.w2`.
        regularisation: e, in the unit of the squared distance.
        unseen: in what the sets differ that the distance does not see; see :func:`segar.metrics.unseen_differences`.
    """

    value: float
    transport: float
    regularisation: float
    unseen: tuple[str, ...] = ()


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
    checks.require_levels("w2_sliced", a, b)
    checks.require_generator("w2_sliced", rng)
    if projections < 2:
        raise LevelError(f"w2_sliced needs at least 2 projections, not {projections}")
    x, y = embed(a, b, scale=scale, mismatch=mismatch, factors=factors)
    unseen = warn_of_unseen("w2_sliced", a, b, "exact", factors, scale)
    dimension = x.shape[1]
    if dimension == 0:
        return SlicedW2(0.0, 0.0, 0, unseen)
    directions = frames(dimension, projections, rng)
    squares = dimension * np.asarray(pot().wasserstein_1d(x @ directions, y @ directions, p=2))
    value = float(np.sqrt(squares.mean()))
    error = float(squares.std(ddof=1) / np.sqrt(len(squares))) if len(squares) > 1 else 0.0
    return SlicedW2(value, error / (2 * value) if value > 0 else 0.0, len(squares), unseen)


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
    unseen = warn_of_unseen("w2_entropic", a, b, mode, factors, scale)
    between = cost(a, b)
    epsilon = regularisation * float(between.mean())
    if epsilon == 0.0:
        return EntropicW2(0.0, 0.0, 0.0, unseen)
    plan = _sinkhorn(between, epsilon)
    transport = float((plan * between).sum())
    square = _objective(plan, between, epsilon)
    for own in (cost(a, a), cost(b, b)):
        square -= 0.5 * _objective(_sinkhorn(own, epsilon), own, epsilon)
    return EntropicW2(float(np.sqrt(max(square, 0.0))), float(np.sqrt(transport)), epsilon, unseen)


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


@dataclass(frozen=True, eq=False)
class UnbalancedW2:
    """A distance that may leave levels behind, and what it left.

    Attributes:
        value: the distance.
        transported: share of the mass of the sets that the plan moves, in [0, 1].
        left_a, left_b: share of each level that has no counterpart, float64 ``[n]`` and ``[m]``, in [0, 1].
        unseen: in what the sets differ that the distance does not see; see :func:`segar.metrics.unseen_differences`.
    """

    value: float
    transported: float
    left_a: np.ndarray
    left_b: np.ndarray
    unseen: tuple[str, ...] = ()


def w2_unbalanced(
    a: Levels,
    b: Levels,
    mode: Mode = "exact",
    *,
    reach: float,
    divergence: Literal["tv", "kl"] = "tv",
    mismatch: float | None = None,
    scale: Spread | None = None,
    factors: Sequence[type[Factor]] | None = None,
) -> UnbalancedW2:
    """The unbalanced Wasserstein-2 distance, sqrt(min over plans G >= 0 of <G, C> + reach^2 (D(G 1 | a) + D(G' 1 | b))).

    The paper asks for it; its code, and :func:`w2`, balance the sets of levels. (That levels differ in their numbers of
    entities is another matter, which ``mode="exact"`` treats by ``mismatch``.) A few odd levels, which balanced transport
    has to serve at any price, cost at most ``reach`` squared each here.

    Args:
        reach: in the unit of the distance.
        divergence: ``"tv"``: D is the mass left behind. Levels farther than sqrt(2) reach from all others stay behind;
            solved exactly, and a metric wherever :func:`w2` is one. ``"kl"``: the Kullback-Leibler divergence; how much
            is moved falls smoothly with distance.
        Others as for :func:`segar.metrics.w2`.

    Raises:
        LevelError: as :func:`w2`, or an unknown divergence, or a reach that is not positive.
        SegarError: the algorithm for ``"kl"`` did not converge.

    Source: Chizat et al. 2018; Chapel et al. 2021 for the algorithm of ``"kl"``.
    """
    if divergence not in ("tv", "kl"):
        raise LevelError(f"w2_unbalanced: unknown divergence '{divergence}'.{did_you_mean(divergence, ('tv', 'kl'))}")
    if not 0 < reach < np.inf:
        raise LevelError(f"w2_unbalanced: reach must be a positive number, not {reach!r}")
    cost = cost_function("w2_unbalanced", a, b, mode, mismatch, scale, factors)(a, b)
    unseen = warn_of_unseen("w2_unbalanced", a, b, mode, factors, scale)
    if divergence == "kl":
        plan = _kl_plan(cost, reach)
        square = float((plan * cost).sum())
        square += reach**2 * sum(_kl(plan.sum(axis=k), 1 / cost.shape[1 - k]) for k in (0, 1))
    else:
        # To leave a pair's mass behind on both sides costs 2 reach^2: balanced transport of that truncated cost.
        plan = plan_of(np.minimum(cost, 2 * reach**2))
        square = float((plan * np.minimum(cost, 2 * reach**2)).sum())
        plan = np.where(cost < 2 * reach**2, plan, 0.0)
    return _result(plan, square, unseen)


def w2_partial(
    a: Levels,
    b: Levels,
    mode: Mode = "exact",
    *,
    mass: float,
    mismatch: float | None = None,
    scale: Spread | None = None,
    factors: Sequence[type[Factor]] | None = None,
) -> UnbalancedW2:
    """The Wasserstein-2 distance of the share ``mass`` of both sets that lie closest together: sqrt(min <G, C> / mass).

    At 1 it is :func:`w2`. Other arguments and errors are those of :func:`w2`; a mass outside (0, 1] is a LevelError.
    """
    if not 0 < mass <= 1:
        raise LevelError(f"w2_partial: mass must lie in (0, 1], not {mass!r}")
    cost = cost_function("w2_partial", a, b, mode, mismatch, scale, factors)(a, b)
    unseen = warn_of_unseen("w2_partial", a, b, mode, factors, scale)
    if mass == 1:
        plan = plan_of(cost)
    else:
        n, m = cost.shape
        plan = pot().partial.partial_wasserstein(
            np.full(n, 1 / n), np.full(m, 1 / m), cost, m=mass, numItermax=TRANSPORT_STEPS
        )
    return _result(plan, float((plan * cost).sum()) / mass, unseen)


def _result(plan: np.ndarray, square: float, unseen: tuple[str, ...]) -> UnbalancedW2:
    n, m = plan.shape
    left_a, left_b = (np.clip(1 - size * plan.sum(axis=axis), 0.0, 1.0) for axis, size in ((1, n), (0, m)))
    left_a, left_b = (np.where(left < 1e-9, 0.0, left) for left in (left_a, left_b))
    return UnbalancedW2(float(np.sqrt(max(square, 0.0))), float(plan.sum()), left_a, left_b, unseen)


def _kl_plan(cost: np.ndarray, reach: float) -> np.ndarray:
    """A plan whose objective is within ``KL_GAP`` of the least, as its dual shows, float64 ``[n, m]``."""
    n, m = cost.shape
    weights = np.full(n, 1 / n), np.full(m, 1 / m)
    plan = None
    for _ in range(KL_ROUNDS):
        plan = pot().unbalanced.mm_unbalanced(
            *weights, cost, reg_m=reach**2, div="kl", G0=plan, numItermax=KL_ITERATIONS, stopThr=0.0
        )
        rows, columns = plan.sum(axis=1), plan.sum(axis=0)
        if not np.isfinite(plan).all() or min(rows.min(), columns.min()) <= 0:
            break
        primal = float((plan * cost).sum()) + reach**2 * (_kl(rows, 1 / n) + _kl(columns, 1 / m))
        # Potentials are feasible if f + g <= C: f is lowered where it is not.
        f, g = -(reach**2) * np.log(n * rows), -(reach**2) * np.log(m * columns)
        f = np.minimum(f, (cost - g).min(axis=1))
        dual = reach**2 * (np.mean(1 - np.exp(-f / reach**2)) + np.mean(1 - np.exp(-g / reach**2)))
        if primal - dual <= KL_GAP * max(primal, KL_GAP * reach**2):
            return plan
    raise SegarError(
        f"unbalanced transport of {n} x {m} levels did not converge in {KL_ROUNDS * KL_ITERATIONS} iterations; take a"
        " larger reach, or divergence='tv'"
    )


def _kl(given: np.ndarray, weight: float) -> float:
    """Kullback-Leibler divergence of masses from equal weights: sum of g log(g / w) - g + w."""
    return float(scipy.special.kl_div(given, weight).sum())
