"""What a distance between level sets is made of: factors, entities, levels, and the part that comes from having few levels."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import scipy

from segar.errors import LevelError
from segar.language import Factor, Parameter, require_own_names
from segar.levels import LevelDistribution, Levels, PointSets, checks, entity_types
from segar.metrics.points import Spread, Units, shorter_way, spread
from segar.metrics.unseen import warn_of_unseen
from segar.metrics.wasserstein import MISMATCH, Mode, cost_function, exact_costs
from segar.support import emd, plan_of

FRESH_SPLIT = "same-distribution floor"
"""Split of the levels that stand for a distribution here, so that they are no train or test levels."""


@dataclass(frozen=True, eq=False)
class Decomposition:
    """The squared ``exact`` distance of two level sets, term by term under an optimal plan.

    Attributes:
        value: the distance, as :func:`segar.metrics.w2` returns it.
        parts: (entity type, factor) to its share of ``value`` squared; (entity type, None) is the price of entities that
            are not matched: those without counterpart, and both of a pair that is farther apart than sqrt(2)
            ``mismatch``, whose factors then have no part; (``Parameter``, parameter) is what a world parameter adds.
            They sum to the square.
        by_level_a, by_level_b: share of the square that each level has in it, float64 ``[n]`` and ``[m]``; each sums to
            the square.
        unseen: in what the sets differ that the distance does not see; see :func:`segar.metrics.unseen_differences`.
    """

    value: float
    parts: dict[tuple[type, type[Factor] | None], float]
    by_level_a: np.ndarray
    by_level_b: np.ndarray
    unseen: tuple[str, ...] = ()

    @property
    def by_entity(self) -> dict[str, float]:
        """Entity type's name (``"world"`` for parameters) to its share of the square, largest first.

        Raises:
            LevelError: two entity types have one name; ``parts`` tells them apart.
        """
        require_own_names("entity types in a decomposition", [entity for entity, _ in self.parts])
        return _sums((_entity(entity), part) for (entity, _), part in self.parts.items())

    @property
    def by_factor(self) -> dict[str, float]:
        """Factor's name (``"unmatched"`` for entities that are not matched) to its share of the square, largest first.

        Raises:
            LevelError: two factors or world parameters have one name; ``parts`` tells them apart.
        """
        require_own_names("factors in a decomposition", [factor for _, factor in self.parts if factor is not None])
        return _sums((_factor(factor), part) for (_, factor), part in self.parts.items())

    @property
    def by_name(self) -> dict[str, float]:
        """``"Charger.Charge"``, ``"Charger.unmatched"``, ``"world.Gravity"`` to its share of the square, largest first.

        Raises:
            LevelError: two entity types or two world parameters have one name; ``parts`` tells them apart.
        """
        require_own_names("entity types in a decomposition", [entity for entity, _ in self.parts])
        require_own_names("world parameters in a decomposition", [f for e, f in self.parts if f and e is Parameter])
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
    units, types = Units.checked("decompose", (a, b), scale, factors), entity_types(a, b)
    checks.require_size("decompose", "mismatch", mismatch)
    unseen = warn_of_unseen("decompose", a, b, "exact", factors, scale)
    costs = exact_costs(a, b, types, units, mismatch)
    plan = plan_of(costs)
    i, j = np.nonzero(plan)
    mass = plan[i, j]
    parts: dict[tuple[type, type[Factor] | None], float] = {}
    for entity in types:
        read = units.factors(entity)
        of_a, of_b = units.state(a, entity), units.state(b, entity)
        squares, unmatched = _matched_squares(of_a, of_b, i, j, mass, mismatch)
        edges = np.cumsum([0] + [f.width for f in read])
        for factor, first, last in zip(read, edges[:-1], edges[1:], strict=True):
            parts[entity, factor] = float(squares[first:last].sum())
        parts[entity, None] = unmatched
    for p in units.parameters(a, b):
        x, y = units.world(a, [p]), units.world(b, [p])
        parts[Parameter, p] = float(mass @ shorter_way(x.points[i] - y.points[j], x.periods)[:, 0] ** 2)
    each = plan * costs
    square = max(float(each.sum()), 0.0)
    return Decomposition(float(np.sqrt(square)), parts, each.sum(axis=1), each.sum(axis=0), unseen)


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
        unseen: in what the sets differ that the distance does not see; see :func:`segar.metrics.unseen_differences`.
    """

    value: float
    floor_a: Floor
    floor_b: Floor
    square: float
    standard_error: float
    debiased: float
    unseen: tuple[str, ...] = ()


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
    ``floor_a`` of n levels and of very many others is how far n levels are from the distribution that they come from. The
    subtraction is that of the energy distance and of the Sinkhorn divergence (Genevay, Peyré and Cuturi 2018), applied to
    squared distances.

    Args:
        rng: seeds the fresh levels; ``repeats`` (at least 2) pairs of sets are drawn.
        Others as for :func:`segar.metrics.w2`.

    Raises:
        LevelError: as :func:`segar.metrics.w2`; too few repeats; or levels do not know their distribution, as those from
            files.
    """
    checks.require_levels("w2_debiased", a, b)
    checks.require_generator("w2_debiased", rng)
    checks.require_count("w2_debiased", "repeats", repeats, 2)
    for levels in (a, b):
        if levels.distribution is None:
            raise LevelError(
                f"w2_debiased draws fresh levels, and {levels!r} do not know their distribution (a level file holds"
                " none). Sample them from it again, or see w2_report, whose floor deals the given levels anew"
            )
    unit = (spread(a, b) if scale is None else scale) if mode == "exact" else None
    options = {"mode": mode, "mismatch": mismatch, "scale": unit, "factors": factors}
    value = _distance("w2_debiased", a, b, options)
    unseen = warn_of_unseen("w2_debiased", a, b, mode, factors, scale)
    of_a, of_b = (checks.require_distribution("w2_debiased", levels.distribution) for levels in (a, b))
    n, m = len(a), len(b)
    pairs = ((of_a, n), (of_a, m)), ((of_b, n), (of_b, m)), ((of_a, n), (of_b, m))
    own_a, own_b, between = (_distances(*pair, rng, repeats, options) for pair in pairs)
    square = value**2 - 0.5 * float((own_a**2).mean() + (own_b**2).mean())
    floor_a, floor_b = (Floor(float(d.mean()), float(d.std(ddof=1)), repeats) for d in (own_a, own_b))
    variances = [float(np.var(d**2, ddof=1)) for d in (own_a, own_b, between)]
    return DebiasedW2(
        value=value,
        floor_a=floor_a,
        floor_b=floor_b,
        square=square,
        standard_error=float(np.sqrt(variances[2] + 0.25 * (variances[0] + variances[1]) / repeats)),
        debiased=float(np.sqrt(max(square, 0.0))),
        unseen=unseen,
    )


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
    found = []
    for _ in range(repeats):
        a, b = (source.sample(n, seed=int(rng.integers(2**62)), split=FRESH_SPLIT) for source, n in (first, second))
        found.append(_distance("w2", a, b, options))
    return np.array(found)


def _distance(what: str, a: Levels, b: Levels, options: dict[str, Any]) -> float:
    """:func:`segar.metrics.w2` in the name of ``what``, without a word on what it does not see."""
    return float(np.sqrt(emd(cost_function(what, a, b, **options)(a, b))))
