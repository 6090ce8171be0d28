"""The factors of levels as sets of points, and the mean and variance of each factor under a distribution."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from segar.language import HULL, Entity, Factor, GlobalFriction, Parameter, Size, polygon_areas
from segar.levels.level_data import LevelData, LevelSource
from segar.noise import wrap

SPREAD_SAMPLE = 2000
"""Levels that stand for a distribution when its spread is measured: 1.6 % standard error of a standard deviation."""

Moments = dict[tuple[type, type[Factor]], tuple[np.ndarray, np.ndarray]]
"""Mean and variance of each component by ``(entity type, factor)``; a world parameter's entity type is ``Parameter``."""


@dataclass(frozen=True)
class PointSets:
    """One set of points per level: ``counts`` int ``[level]``, and ``points`` float64 ``[sum of counts, dimension]``."""

    counts: np.ndarray
    points: np.ndarray
    periods: np.ndarray | None = None
    """Period of each component, float64 ``[dimension]``, infinite on the line; None where all components are on the line."""

    def with_count(self, count: int) -> tuple[np.ndarray, np.ndarray]:
        """Indices of the levels with ``count`` points, int ``[m]``, and these points, float64 ``[m, count, dimension]``."""
        levels = np.flatnonzero(self.counts == count)
        first = np.concatenate(([0], np.cumsum(self.counts)))[levels]
        return levels, self.points[first[:, None] + np.arange(count)]


def entity_types(*sets: LevelData) -> list[type[Entity]]:
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


def gather(
    levels: LevelData, types: Iterable[type[Entity]], factors: Sequence[type[Factor]], values: np.ndarray
) -> PointSets:
    """The vectors of all entities of ``types``: the given factors in the given order, read from ``values``."""
    indices = [levels.layout.types.index(t) for t in types if t in levels.layout.types]
    member = np.isin(levels.types, indices)
    level, slot = np.nonzero(member)
    columns = [levels.layout.columns[f] + k for f in factors for k in range(f.width)] if len(level) else []
    points = values[level, slot][:, columns] if columns else np.zeros((len(level), sum(f.width for f in factors)))
    return PointSets(member.sum(axis=1), points)


def gather_state(levels: LevelData, entity: type[Entity], factors: Sequence[type[Factor]]) -> PointSets:
    """Vectors of the entities of one type in the states that episodes start in.

    The Size of a convex hull is the diameter of the disc of equal area, since its outline does not follow Size.
    """
    found = gather(levels, [entity], factors, levels.values)
    if Size not in factors or not len(found.points):
        return found
    level, slot = np.nonzero(levels.types == levels.layout.types.index(entity))
    hull = levels.shape_kind[level, slot] == HULL
    if hull.any():
        areas = polygon_areas(levels.vertices[level[hull], slot[hull]], levels.vertex_count[level[hull], slot[hull]])
        column = sum(f.width for f in factors[: list(factors).index(Size)])
        found.points[hull, column] = 2 * np.sqrt(areas / np.pi)
    return found


def gather_parameters(levels: LevelData, parameters: Sequence[type[Parameter]]) -> PointSets:
    """The world parameters of each level as one point; a parameter that the levels do not know has its default."""
    known = levels.layout.parameters
    columns = [
        levels.parameters[:, known.index(p)] if p in known else np.full(len(levels), float(p.default))
        for p in parameters
    ]
    return PointSets(np.ones(len(levels), np.int64), np.stack(columns, axis=1))


def source_moments(levels: LevelData) -> Mapping[tuple[type, type[Factor]], tuple[np.ndarray, np.ndarray]]:
    """Moments of the distribution that the levels come from; none for levels made by hand."""
    return levels.moments if levels.distribution is None else moments_of_distribution(levels.distribution)


@lru_cache(maxsize=64)
def moments_of_distribution(distribution: LevelSource) -> Moments:
    """Moments of a distribution, from levels that stand for it; always the same ones."""
    return moments_of_levels(distribution.sample(SPREAD_SAMPLE, seed=0, split="spread"))


def moments_of_levels(levels: LevelData) -> Moments:
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
            found[entity, factor] = mean_and_variance(points[:, i:j], factor.period)
    return found


def mean_and_variance(values: np.ndarray, period: float | None) -> tuple[np.ndarray, np.ndarray]:
    """Mean and variance of each column of ``values``, float64 ``[n, columns]``.

    On a circle, the mean direction, and the mean square of the distances from it.
    """
    if period is None:
        return values.mean(axis=0), values.var(axis=0)
    turn = 2 * np.pi / period
    mean = np.arctan2(np.sin(values * turn).mean(axis=0), np.cos(values * turn).mean(axis=0)) / turn
    return mean, (wrap(values - mean, period) ** 2).mean(axis=0)
