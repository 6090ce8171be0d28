"""What a distance between level sets is made of: which factors, which entities, which levels."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import scipy

from segar.language import Factor, Parameter
from segar.levels import Levels, PointSets, entity_types
from segar.metrics.points import (
    Spread,
    checked_units,
    scaled_parameters,
    scaled_state,
    shorter_way,
    weighed_factors,
    weighed_parameters,
)
from segar.metrics.wasserstein import MISMATCH, exact_costs
from segar.support import plan_of

NEGLIGIBLE = 1e-15  # mass of a pair of levels below which it is a rounding error of zero


@dataclass(frozen=True, eq=False)
class Decomposition:
    """The squared ``exact`` distance of two level sets, term by term under an optimal plan.

    Attributes:
        value: the distance, as :func:`segar.metrics.w2` returns it.
        parts: (entity type, factor) to its share of ``value`` squared; (entity type, None) is the price of entities
            without counterpart, and (``Parameter``, parameter) what a world parameter adds. They sum to the square.
        by_level_a, by_level_b: share of the square that each level has in it, float64 ``[n]`` and ``[m]``; each sums to
            the square.
    """

    value: float
    parts: dict[tuple[type, type[Factor] | None], float]
    by_level_a: np.ndarray
    by_level_b: np.ndarray

    @property
    def by_entity(self) -> dict[str, float]:
        """Entity type's name (``"world"`` for parameters) to its share of the square, largest first."""
        return _sums((_entity(entity), part) for (entity, _), part in self.parts.items())

    @property
    def by_factor(self) -> dict[str, float]:
        """Factor's name (``"unmatched"`` for entities without counterpart) to its share of the square, largest first."""
        return _sums((_factor(factor), part) for (_, factor), part in self.parts.items())

    @property
    def by_name(self) -> dict[str, float]:
        """``"Charger.Charge"``, ``"Charger.unmatched"``, ``"world.Gravity"`` to its share of the square, largest first."""
        return _sums((f"{_entity(e)}.{_factor(f)}", part) for (e, f), part in self.parts.items())


def decompose(
    a: Levels,
    b: Levels,
    *,
    mismatch: float = MISMATCH,
    scale: Spread | None = None,
    factors: Sequence[type[Factor]] | None = None,
) -> Decomposition:
    """Which factors, entities and levels ``w2(a, b, mode="exact")`` squared comes from.

    Under an optimal plan of levels, and the best matching of their entities, the square is a sum over matched entities
    and their factors, entities left over, and world parameters. Where several plans are optimal, it is one of them.
    Arguments and errors are those of :func:`segar.metrics.w2`. The distance is that of the paper's Algorithm 1.
    """
    unit, types = checked_units("decompose", (a, b), scale, factors), entity_types(a, b)
    costs = exact_costs(a, b, types, unit, mismatch, factors)
    plan = plan_of(costs)
    i, j = np.nonzero(plan > NEGLIGIBLE)
    mass = plan[i, j]
    parts: dict[tuple[type, type[Factor] | None], float] = {}
    for entity in types:
        read = weighed_factors(entity, unit, factors)
        of_a, of_b = (scaled_state(x, entity, read, unit) for x in (a, b))
        squares, unmatched = _matched_squares(of_a, of_b, i, j, mass, mismatch)
        edges = np.cumsum([0] + [f.width for f in read])
        for factor, first, last in zip(read, edges[:-1], edges[1:], strict=True):
            parts[entity, factor] = float(squares[first:last].sum())
        parts[entity, None] = unmatched
    for p in weighed_parameters((a, b), unit, factors):
        x, y = (scaled_parameters(levels, [p], unit) for levels in (a, b))
        parts[Parameter, p] = float(mass @ shorter_way(x.points[i] - y.points[j], x.periods)[:, 0] ** 2)
    each = plan * costs
    square = max(float(each.sum()), 0.0)
    return Decomposition(float(np.sqrt(square)), parts, each.sum(axis=1), each.sum(axis=0))


def _matched_squares(
    a: PointSets, b: PointSets, i: np.ndarray, j: np.ndarray, mass: np.ndarray, mismatch: float
) -> tuple[np.ndarray, float]:
    """Squared differences of matched points by component, float64 ``[dimension]``, and the price of the others.

    Both are sums over pairs of levels ``i``, ``j`` with weights ``mass``; points are matched as in
    :func:`segar.metrics.transport.matching_costs`.
    """
    first_a, first_b = (np.concatenate(([0], np.cumsum(s.counts))) for s in (a, b))
    squares, unmatched = np.zeros(a.points.shape[1]), 0.0
    for level_a, level_b, weight in zip(i, j, mass, strict=True):
        x, y = a.points[first_a[level_a] : first_a[level_a + 1]], b.points[first_b[level_b] : first_b[level_b + 1]]
        differences = shorter_way(x[:, None] - y[None], a.periods) ** 2
        pairs = differences.sum(axis=-1)
        rows, columns = scipy.optimize.linear_sum_assignment(np.minimum(pairs, 2 * mismatch**2))
        kept = pairs[rows, columns] < 2 * mismatch**2
        squares += weight * differences[rows[kept], columns[kept]].sum(axis=0)
        unmatched += weight * mismatch**2 * (len(x) + len(y) - 2 * kept.sum())
    return squares, float(unmatched)


def _entity(entity: type) -> str:
    return "world" if entity is Parameter else entity.__name__


def _factor(factor: type[Factor] | None) -> str:
    return "unmatched" if factor is None else factor.__name__


def _sums(pairs) -> dict[str, float]:
    found: dict[str, float] = {}
    for name, part in pairs:
        found[name] = found.get(name, 0.0) + part
    return dict(sorted(found.items(), key=lambda item: -item[1]))
