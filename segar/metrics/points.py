"""Levels as sets of vectors: which entities and factors a distance looks at, and in which units."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import TYPE_CHECKING

import numpy as np

from segar.levels.checks import require_distribution
from segar.language.entities import Entity, GlobalFriction
from segar.language.factors import Acceleration, Alive, Density, Done, Drag, Factor, Order, Size, Visible
from segar.levels.level_set import Levels
from segar.noise.circle import wrap
from segar.language.parameters import Parameter
from segar.language.shapes import HULL

if TYPE_CHECKING:
    from segar.levels.distribution import LevelDistribution

IRRELEVANT: tuple[type[Factor], ...] = (Order, Visible, Alive, Done, Acceleration, Drag, Density)
"""Factors that say nothing of where a level leads: rendering, flags that every level starts with, quantities derived
from others, and Density, which no rule reads. All other numeric factors count, a user's own included."""

SPREAD_SAMPLE = 2000
"""Levels that stand for a distribution when its spread is measured: 1.6 % standard error of a standard deviation."""

Moments = dict[tuple[type, type[Factor]], tuple[np.ndarray, np.ndarray]]
"""Mean and variance of each component by ``(entity type, factor)``; a world parameter's entity type is ``Parameter``."""

Spread = dict[tuple[type, type[Factor]], float]
"""Standard deviation by ``(entity type, factor)``; a world parameter's entity type is ``Parameter``."""


@dataclass(frozen=True)
class PointSets:
    """One set of points per level: ``counts`` int ``[level]``, and ``points`` float64 ``[sum of counts, dimension]``."""

    counts: np.ndarray
    points: np.ndarray
    periods: np.ndarray | None = None
    """Of each component, float64 ``[dimension]``, infinite where it is not one that comes round; None where none is."""

    def with_count(self, count: int) -> tuple[np.ndarray, np.ndarray]:
        """Indices of the levels with ``count`` points, int ``[m]``, and these points, float64 ``[m, count, dimension]``."""
        levels = np.flatnonzero(self.counts == count)
        first = np.concatenate(([0], np.cumsum(self.counts)))[levels]
        return levels, self.points[first[:, None] + np.arange(count)]


def entity_types(*sets: Levels) -> list[type[Entity]]:
    """The entity types present in any level, in order of first appearance (set, then level, then slot).

    The arena's floor is left out: it is no entity of the initial state, and its friction is a world parameter.
    """
    found: dict[type[Entity], None] = {}
    for levels in sets:
        present = levels.types[levels.types >= 0]
        indices, first = np.unique(present, return_index=True)
        for index in indices[np.argsort(first)]:
            found.setdefault(levels.layout.types[index])
    return [t for t in found if not issubclass(t, GlobalFriction)]


def relevant_factors(entity: type[Entity], only: Sequence[type[Factor]] | None = None) -> list[type[Factor]]:
    """The factors of an entity type that count, in order of declaration: ``only`` these, else all but ``IRRELEVANT``."""
    declared = [f for f in entity.declared if f.width]
    return [f for f in declared if (f in only if only is not None else f not in IRRELEVANT)]


def weighed_factors(
    entity: type[Entity], scale: Spread, only: Sequence[type[Factor]] | None = None
) -> list[type[Factor]]:
    """The relevant factors of an entity type that have a spread; those without have no weight."""
    return [f for f in relevant_factors(entity, only) if scale.get((entity, f), 0.0) > 0.0]


def weighed_parameters(
    sets: Iterable[Levels], scale: Spread, only: Sequence[type[Factor]] | None = None
) -> list[type[Parameter]]:
    """The world parameters that any of the sets knows and that have a spread: ``only`` these, else all."""
    known = all_parameters(*sets)
    return [p for p in known if scale.get((Parameter, p), 0.0) > 0.0 and (only is None or p in only)]


def gather(
    levels: Levels, types: Iterable[type[Entity]], factors: Sequence[type[Factor]], values: np.ndarray
) -> PointSets:
    """The vectors of all entities of ``types``: the given factors in the given order, read from ``values``."""
    indices = [levels.layout.types.index(t) for t in types if t in levels.layout.types]
    member = np.isin(levels.types, indices)
    level, slot = np.nonzero(member)
    columns = [levels.layout.columns[f] + k for f in factors for k in range(f.width)] if len(level) else []
    points = values[level, slot][:, columns] if columns else np.zeros((len(level), sum(f.width for f in factors)))
    return PointSets(member.sum(axis=1), points)


def gather_state(levels: Levels, entity: type[Entity], factors: Sequence[type[Factor]]) -> PointSets:
    """Vectors of the entities of one type in the states that episodes start in.

    The Size of a convex hull is the diameter of the disc of equal area, since its outline does not follow Size.
    """
    found = gather(levels, [entity], factors, levels.values)
    if Size not in factors or not len(found.points):
        return found
    level, slot = np.nonzero(levels.types == levels.layout.types.index(entity))
    hull = levels.shape_kind[level, slot] == HULL
    if hull.any():
        areas = _polygon_areas(levels.vertices[level[hull], slot[hull]], levels.vertex_count[level[hull], slot[hull]])
        column = sum(f.width for f in factors[: list(factors).index(Size)])
        found.points[hull, column] = 2 * np.sqrt(areas / np.pi)
    return found


def gather_parameters(levels: Levels, parameters: Sequence[type[Parameter]]) -> PointSets:
    """The world parameters of each level as one point; a parameter that the levels do not know has its default."""
    known = levels.layout.parameters
    columns = [
        levels.parameters[:, known.index(p)] if p in known else np.full(len(levels), float(p.default))
        for p in parameters
    ]
    return PointSets(np.ones(len(levels), np.int64), np.stack(columns, axis=1))


def scaled_state(levels: Levels, entity: type[Entity], factors: Sequence[type[Factor]], scale: Spread) -> PointSets:
    """As :func:`gather_state`, in units of the factors' spread."""
    unit = np.array([scale[entity, f] for f in factors])
    widths = [f.width for f in factors]
    found = gather_state(levels, entity, factors)
    periods = scaled_periods(factors, unit)
    return PointSets(
        found.counts, found.points / np.repeat(unit, widths), None if periods is None else np.repeat(periods, widths)
    )


def scaled_parameters(levels: Levels, parameters: Sequence[type[Parameter]], scale: Spread) -> PointSets:
    """As :func:`gather_parameters`, in units of the parameters' spread."""
    found = gather_parameters(levels, parameters)
    unit = np.array([scale[Parameter, p] for p in parameters])
    return PointSets(found.counts, found.points / unit, scaled_periods(parameters, unit))


def scaled_periods(factors: Sequence[type[Factor]], unit: np.ndarray) -> np.ndarray | None:
    """Periods in these units, float64 ``[factors]``, infinite where there is none; None where all are."""
    if all(f.period is None for f in factors):
        return None
    return np.array([np.inf if f.period is None else f.period for f in factors]) / unit


def cut(values: np.ndarray, factor: type[Factor]) -> np.ndarray:
    """Numbers of a factor that comes round, as numbers between minus and plus half its period; others as they are."""
    return values if factor.period is None else wrap(values, factor.period)


def shorter_way(difference: np.ndarray, periods: np.ndarray | None) -> np.ndarray:
    """Differences, components on the last axis, along the shorter way round where a component has a period."""
    if periods is None:
        return difference
    finite = np.isfinite(periods)
    difference = difference.copy()
    difference[..., finite] -= periods[finite] * np.rint(difference[..., finite] / periods[finite])
    return difference


def all_parameters(*sets: Levels) -> list[type[Parameter]]:
    """The world parameters that any of the sets knows."""
    return list(dict.fromkeys(p for levels in sets for p in levels.layout.parameters))


def spread(*sets: Levels | LevelDistribution) -> Spread:
    """Standard deviation of every factor of every entity type, under the mixture of the given laws in equal parts.

    A level set that carries its distribution stands for it (by ``SPREAD_SAMPLE`` levels of a fixed seed), and one from
    a file for the distribution that it had when it was saved; one made by hand stands for itself. A vector factor has
    one spread, the root mean square of its components', so that directions in the arena stay comparable. Pass the
    result to :func:`segar.metrics.w2` to measure several pairs in one unit.

    Returns:
        ``{(entity type, factor): standard deviation}``; 0 for what is constant.
    """
    moments = []
    for one in sets:
        if not isinstance(one, Levels):
            require_distribution("spread", one)
        # A type too rare for the law's sample is measured on the levels themselves.
        moments.append({**_moments(one), **law_moments(one)} if isinstance(one, Levels) else _moments_of(one))
    found: Spread = {}
    for key in dict.fromkeys(key for known in moments for key in known):
        means, variances = (np.stack(values) for values in zip(*(m[key] for m in moments if key in m), strict=True))
        variance = variances.mean(axis=0) + _mean_and_variance(means, key[1].period)[1]
        # What is constant may differ in its last bit after arithmetic; that is no spread.
        variance[variance <= (1e-9 * np.abs(means).max(axis=0)) ** 2] = 0.0
        found[key] = float(np.sqrt(variance.mean()))
    return found


def law_moments(levels: Levels) -> Mapping[tuple[type, type[Factor]], tuple[np.ndarray, np.ndarray]]:
    """Moments of the distribution that levels come from; none for levels made by hand."""
    return levels.moments if levels.distribution is None else _moments_of(levels.distribution)


@lru_cache(maxsize=64)
def _moments_of(law: LevelDistribution) -> Moments:
    """Moments of a distribution, from levels that stand for it; always the same ones."""
    return _moments(law.sample(SPREAD_SAMPLE, seed=0, split="spread"))


def _moments(levels: Levels) -> Moments:
    """Mean and variance of each component of every factor, by entity type (``Parameter`` for the world's) and factor."""
    parameters = levels.layout.parameters
    groups: list[tuple[type, Sequence[type[Factor]], np.ndarray]] = [
        (Parameter, parameters, gather_parameters(levels, parameters).points)
    ]
    for entity in entity_types(levels):
        factors = [f for f in entity.declared if f.width]
        groups.append((entity, factors, gather_state(levels, entity, factors).points))
    found = {}
    for entity, factors, points in groups:
        edges = np.cumsum([0] + [f.width for f in factors])
        for factor, i, j in zip(factors, edges[:-1], edges[1:], strict=True):
            found[entity, factor] = _mean_and_variance(points[:, i:j], factor.period)
    return found


def _mean_and_variance(values: np.ndarray, period: float | None) -> tuple[np.ndarray, np.ndarray]:
    """Of each column; on the circle the mean direction, and the mean square of the ways from it."""
    if period is None:
        return values.mean(axis=0), values.var(axis=0)
    turn = 2 * np.pi / period
    mean = np.arctan2(np.sin(values * turn).mean(axis=0), np.cos(values * turn).mean(axis=0)) / turn
    return mean, (wrap(values - mean, period) ** 2).mean(axis=0)


def _polygon_areas(vertices: np.ndarray, counts: np.ndarray) -> np.ndarray:
    """Areas of convex polygons, vertices float64 ``[n, V, 2]`` padded beyond ``counts``, by the shoelace formula."""
    k = np.arange(vertices.shape[1])
    following = np.where(k + 1 < counts[:, None], k + 1, 0)
    after = np.take_along_axis(vertices, following[..., None], axis=1)
    cross = vertices[..., 0] * after[..., 1] - vertices[..., 1] * after[..., 0]
    return 0.5 * np.where(k < counts[:, None], cross, 0.0).sum(axis=1)
