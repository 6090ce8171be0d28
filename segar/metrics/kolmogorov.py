"""Kolmogorov-Smirnov statistics between two level sets, per factor and for all factors at once."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from segar.factors import Factor
from segar.levels import Levels
from segar.metrics.points import (
    all_parameters,
    entity_types,
    gather_parameters,
    gather_state,
    relevant_factors,
    require_levels,
)


def ks(a: Levels, b: Levels, *, factors: Sequence[type[Factor]] | None = None) -> float:
    """The two-sample Kolmogorov-Smirnov statistic of two level sets under the mean-field law, in [0, 1].

    KS = sup_x |prod_j F_j(x_j) - prod_j G_j(x_j)|, F_j and G_j the empirical distribution functions of the j-th marginal
    in a and b: every component of every relevant factor of every entity type (over all entities of that type), the number
    of entities of each type in a level, and every world parameter. The paper's text has probabilities P[X_j = x_j] in the
    product; distribution functions are meant, as in its Algorithm 2. The supremum is exact.

    Args:
        factors: count these factors and no others (numbers of entities count always).

    Raises:
        LevelError: one of the two is not a level set. A sample against a law, and a law against a law, are not supported.
    """
    curves = _distribution_functions(a, b, factors)
    return max(_largest_difference(curves), _largest_difference([(g, f) for f, g in curves]))


def ks_by_factor(a: Levels, b: Levels, *, factors: Sequence[type[Factor]] | None = None) -> dict[str, float]:
    """The two-sample Kolmogorov-Smirnov statistic sup_x |F_j(x) - G_j(x)| of each marginal, by name.

    Names are ``"Charger.Charge"``, ``"GolfBall.Position.x"``, ``"Charger.count"`` (entities of the type per level) and
    ``"world.Gravity"``. A factor is compared among the entities that there are: of a type that one set lacks, there is the
    count alone. Arguments and errors are those of :func:`ks`.
    """
    names = [name for name, _, _ in _marginals(a, b, factors)]
    curves = _distribution_functions(a, b, factors)
    return {name: float(np.abs(f - g).max()) for name, (f, g) in zip(names, curves, strict=True)}


def _marginals(
    a: Levels, b: Levels, factors: Sequence[type[Factor]] | None
) -> list[tuple[str, np.ndarray, np.ndarray]]:
    """Name and both samples of each marginal."""
    require_levels("ks", a, b)
    found = []
    for entity in entity_types(a, b):
        read = relevant_factors(entity, factors)
        of_a, of_b = gather_state(a, entity, read), gather_state(b, entity, read)
        found.append((f"{entity.__name__}.count", of_a.counts, of_b.counts))
        if len(of_a.points) and len(of_b.points):
            names = [
                f"{entity.__name__}.{f.__name__}{axis}" for f in read for axis in (("",), (".x", ".y"))[f.width - 1]
            ]
            found += [(name, of_a.points[:, k], of_b.points[:, k]) for k, name in enumerate(names)]
    parameters = [p for p in all_parameters(a, b) if factors is None or p in factors]
    if parameters:
        of_a, of_b = gather_parameters(a, parameters), gather_parameters(b, parameters)
        found += [(f"world.{p.__name__}", of_a.points[:, k], of_b.points[:, k]) for k, p in enumerate(parameters)]
    return found


def _distribution_functions(
    a: Levels, b: Levels, factors: Sequence[type[Factor]] | None
) -> list[tuple[np.ndarray, np.ndarray]]:
    """Both empirical distribution functions of each marginal, at all values that either sample takes."""
    curves = []
    for _, x, y in _marginals(a, b, factors):
        at = np.union1d(x, y)
        f, g = (np.searchsorted(np.sort(s), at, side="right") / len(s) for s in (x, y))
        curves.append((f, g))
    return curves


def _largest_difference(curves: list[tuple[np.ndarray, np.ndarray]]) -> float:
    """max over x of prod_j F_j(x_j) - prod_j G_j(x_j), exactly, for curves ``(F_j, G_j)``.

    For any choice in the factors still to come, the difference is p P - q Q with p, q >= 0, linear in the products (P, Q)
    so far. So of all (P, Q), only those on the edge of their convex hull towards large P and small Q can win.
    """
    products = np.array([[1.0, 1.0]])
    for f, g in curves:
        steps = _edge(np.stack([f, g], axis=1))
        products = _edge((products[:, None, :] * steps[None, :, :]).reshape(-1, 2))
    return float((products[:, 0] - products[:, 1]).max())


def _edge(points: np.ndarray) -> np.ndarray:
    """The vertices of the hull of ``points [n, 2]`` that maximise some p x - q y with p, q >= 0 (monotone chain)."""
    chain: list[tuple[float, float]] = []
    for x, y in points[np.lexsort((points[:, 1], -points[:, 0]))].tolist():
        if chain and y >= chain[-1][1]:
            continue  # further left and not lower: never better
        while len(chain) > 1 and _turns_inwards(chain[-2], chain[-1], (x, y)):
            chain.pop()
        chain.append((x, y))
    return np.array(chain)


def _turns_inwards(a: tuple[float, float], b: tuple[float, float], c: tuple[float, float]) -> bool:
    return (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]) >= 0.0
