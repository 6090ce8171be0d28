"""Optimal transport on cost matrices, by Python Optimal Transport: loaded on first use, and without its other back ends."""

import os
from types import ModuleType
from typing import Any

import numpy as np

from segar.errors import SegarError

# Of the network simplex, at most; POT's own 100 000 are too few for some 500 x 200 problems.
TRANSPORT_STEPS = 10_000_000
BACKENDS = ("PYTORCH", "JAX", "CUPY", "TENSORFLOW")


def pot() -> ModuleType:
    """The module ``ot``, imported on first use, without the array libraries that only its other back ends need."""
    for backend in BACKENDS:
        os.environ.setdefault(f"POT_BACKEND_DISABLE_{backend}", "1")
    import ot

    return ot


def emd(cost: np.ndarray, weights_a: np.ndarray | None = None, weights_b: np.ndarray | None = None) -> float:
    """The least cost of balanced transport, min <G, C> over plans G with the given marginals (uniform if None).

    Args:
        cost: float64 ``[n, m]``, finite.
        weights_a, weights_b: float64 ``[n]`` and ``[m]``, each summing to 1.

    Raises:
        SegarError: the solver did not converge.
    """
    n, m = cost.shape
    a = np.full(n, 1 / n) if weights_a is None else weights_a
    b = np.full(m, 1 / m) if weights_b is None else weights_b
    if n == 1 or m == 1:  # there is only one plan
        return float(a @ cost @ b)
    return float(max(_solve("emd2", a, b, cost), 0.0))


def plan_of(cost: np.ndarray) -> np.ndarray:
    """A plan of least cost between uniform weights, float64 ``[n, m]`` summing to 1; at most n + m - 1 entries are not 0."""
    n, m = cost.shape
    if n == 1 or m == 1:
        return np.full((n, m), 1 / (n * m))
    return _solve("emd", np.full(n, 1 / n), np.full(m, 1 / m), cost)


def _solve(solver: str, a: np.ndarray, b: np.ndarray, cost: np.ndarray) -> Any:
    """The result of POT's network simplex: the plan (``emd``) or its cost (``emd2``)."""
    found, log = getattr(pot(), solver)(a, b, np.ascontiguousarray(cost), numItermax=TRANSPORT_STEPS, log=True)
    if log["warning"] is not None:
        raise SegarError(f"optimal transport of {len(a)} x {len(b)} points did not converge: {log['warning']}")
    return found
