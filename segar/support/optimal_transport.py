"""Optimal transport on cost matrices, by Python Optimal Transport: loaded on first use, and without its other back ends."""

import os
from types import ModuleType

import numpy as np

from segar.errors import SegarError

# Of the network simplex, at most; POT's own 100 000 are too few for some 500 x 200 problems.
TRANSPORT_STEPS = 10_000_000
ROUNDS = 30  # of solving again what a proof leaves, at most; seven were the most for costs from 1e-30 to 1e30
PASSES = 30  # of the search for a proof, from either start
EXACT = 3e-10  # part of the least cost that is left unproven
ROUNDING = 4e-16  # of the sum of two potentials, as a part of them
DUST = 1e-14  # part of a mass that is left where masses should cancel
BACKENDS = ("PYTORCH", "JAX", "CUPY", "TENSORFLOW")


def pot() -> ModuleType:
    """The module ``ot``, imported on first use, without the array libraries that only its other back ends need."""
    for backend in BACKENDS:
        os.environ.setdefault(f"POT_BACKEND_DISABLE_{backend}", "1")
    import ot

    return ot


def emd(cost: np.ndarray, weights_a: np.ndarray | None = None, weights_b: np.ndarray | None = None) -> float:
    """The least cost of balanced transport, min <G, C> over plans G with the given marginals, proven to 3e-10 of it.

    Args:
        cost: float64 ``[n, m]``, finite and not negative, of any scale.
        weights_a, weights_b: float64 ``[n]`` and ``[m]``, masses of any sum, which count in proportion; all equal if None.
            Whole numbers are taken exactly.

    Raises:
        SegarError: a cost is not finite, or no plan was proven: masses 1e15 apart, with costs 1e12 apart, may have none.
    """
    weights = zip(cost.shape, (weights_a, weights_b), strict=True)
    given = (np.ones(count) if w is None else np.asarray(w, np.float64) for count, w in weights)
    (rows, a), (columns, b) = ((np.flatnonzero(w), w[w > 0]) for w in given)
    a, b = (np.ldexp(w, -np.frexp(w.sum())[1]) for w in (a, b))  # about 1: POT compares sums with a constant
    cost = cost[np.ix_(rows, columns)]
    return float((_solve(a * b.sum(), b * a.sum(), cost) * cost).sum() / (a.sum() * b.sum()))


def plan_of(cost: np.ndarray) -> np.ndarray:
    """A plan of least cost between uniform weights, float64 ``[n, m]`` summing to 1; at most n + m - 1 entries are not 0 if
    no side has a single point. Arguments and errors are those of :func:`emd`."""
    n, m = cost.shape
    return _solve(np.full(n, float(m)), np.full(m, float(n)), cost) / (n * m)


def _solve(a: np.ndarray, b: np.ndarray, cost: np.ndarray) -> np.ndarray:
    """A plan of least cost between masses of one sum, all above 0.

    POT's network simplex forgives 1e-15 of the largest cost, and one huge cost may make that more than the result. So plans
    are proven by dual potentials. Where these do not prove one, what they leave of the costs is solved anew, in its own
    units and cut off where no plan that is better could go (iterative refinement: Gleixner, Steffy and Wolter 2016).
    """
    if not np.isfinite(cost).all():
        raise SegarError("optimal transport needs costs that are finite numbers")
    plan = np.outer(a, b) / a.sum()
    if 1 in cost.shape:  # there is only one
        return plan
    smallest_flow = min(a.min(), b.min()) / max(cost.shape)  # of masses that are multiples of one number
    gap, u, v = float((plan * cost).sum()), np.zeros(len(a)), np.zeros(len(b))
    for _ in range(ROUNDS):
        with np.errstate(over="ignore"):  # the least mass may be so small that no cost is cut off
            left = np.minimum(cost - u[:, None] - v, gap / smallest_flow)
        unit = left.max() or 1.0
        found, log = pot().emd(a, b, left / unit, numItermax=TRANSPORT_STEPS, log=True)
        if log["warning"] is not None:
            raise SegarError(f"optimal transport of {len(a)} x {len(b)} points did not converge: {log['warning']}")
        found[found < DUST * np.minimum(a[:, None], b)] = 0.0
        plan = min(found, plan, key=lambda one: (one * cost).sum())
        # Of masses that are too small beside the others to be moved exactly.
        lacking = plan.sum(axis=1) - a, plan.sum(axis=0) - b
        gap, u, v = _proof(plan, cost, u + unit * log["u"])
        gap += abs(float(lacking[0] @ u + lacking[1] @ v))
        if gap <= EXACT * (plan * cost).sum():
            return plan
    raise SegarError(f"optimal transport of {len(a)} x {len(b)} points: no plan was proven to be the best, by {gap:g}")


def _proof(plan: np.ndarray, cost: np.ndarray, start: np.ndarray) -> tuple[float, np.ndarray, np.ndarray]:
    """Dual potentials u, v with u + v <= cost, and what the plan costs more than they prove to be the least, rounding included.

    From the potentials ``start``, and from zeros, shortest ways are followed through the costs and back along the plan: these
    are no larger than what the plan pays, while POT's may be as large as the largest cost, and so less precise.
    """
    i, j = np.nonzero(plan)
    mass, paid = plan[i, j], cost[i, j]
    best = float(mass @ paid), np.zeros(len(cost)), np.zeros(cost.shape[1])
    for u in (start, np.zeros(len(cost))):
        for _ in range(PASSES):
            v = (cost - u[:, None]).min(axis=0)
            gap = float(mass @ (paid - u[i] - v[j] + ROUNDING * (abs(u[i]) + abs(v[j]))))
            best = min(best, (gap, u, v), key=lambda one: one[0])
            if best[0] <= EXACT * (mass @ paid):
                return best
            u = u.copy()
            np.maximum.at(u, i, paid - v[j])
    return best
