"""Transport that may leave levels behind: unbalanced and partial Wasserstein-2 distances between level sets."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
import scipy

from segar.errors import LevelError, SegarError, did_you_mean
from segar.language import Factor
from segar.levels import Levels
from segar.metrics.points import Spread
from segar.metrics.wasserstein import Mode, cost_function
from segar.support import TRANSPORT_STEPS, plan_of, pot

KL_ITERATIONS = 500  # between two looks at the duality gap
KL_ROUNDS = 40
KL_GAP = 1e-3  # share of the objective that may be left to gain


@dataclass(frozen=True, eq=False)
class UnbalancedW2:
    """A distance that may leave levels behind, and what it left.

    Attributes:
        value: the distance.
        transported: share of the mass of the sets that the plan moves, in [0, 1].
        left_a, left_b: share of each level that has no counterpart, float64 ``[n]`` and ``[m]``, in [0, 1].
    """

    value: float
    transported: float
    left_a: np.ndarray
    left_b: np.ndarray


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
    if divergence == "kl":
        plan = _kl_plan(cost, reach)
        square = float((plan * cost).sum())
        square += reach**2 * sum(_kl(plan.sum(axis=k), 1 / cost.shape[1 - k]) for k in (0, 1))
    else:
        # To leave a pair's mass behind on both sides costs 2 reach^2: balanced transport of that truncated cost.
        plan = plan_of(np.minimum(cost, 2 * reach**2))
        square = float((plan * np.minimum(cost, 2 * reach**2)).sum())
        plan = np.where(cost < 2 * reach**2, plan, 0.0)
    return _result(plan, square)


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
    if mass == 1:
        plan = plan_of(cost)
    else:
        n, m = cost.shape
        plan = pot().partial.partial_wasserstein(
            np.full(n, 1 / n), np.full(m, 1 / m), cost, m=mass, numItermax=TRANSPORT_STEPS
        )
    return _result(plan, float((plan * cost).sum()) / mass)


def _result(plan: np.ndarray, square: float) -> UnbalancedW2:
    n, m = plan.shape
    left_a, left_b = (np.clip(1 - size * plan.sum(axis=axis), 0.0, 1.0) for axis, size in ((1, n), (0, m)))
    left_a, left_b = (np.where(left < 1e-9, 0.0, left) for left in (left_a, left_b))
    return UnbalancedW2(float(np.sqrt(max(square, 0.0))), float(plan.sum()), left_a, left_b)


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
