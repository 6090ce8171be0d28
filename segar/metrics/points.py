"""Levels as sets of vectors: which entities and factors a distance looks at, and in which units."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from segar.errors import LevelError
from segar.language import Acceleration, Alive, Density, Done, Drag, Entity, Factor, Order, Parameter, Visible
from segar.levels import LevelDistribution, Levels, PointSets, checks, moments
from segar.noise import wrap

IRRELEVANT: tuple[type[Factor], ...] = (Order, Visible, Alive, Done, Acceleration, Drag, Density)
"""Factors that say nothing of where a level leads: rendering, flags that every level starts with, quantities derived
from others, and Density, which no rule reads. All other numeric factors count, a user's own included."""

Spread = dict[tuple[type, type[Factor]], float]
"""Standard deviation by ``(entity type, factor)``; a world parameter's entity type is ``Parameter``."""


def relevant_factors(entity: type[Entity], only: Sequence[type[Factor]] | None = None) -> list[type[Factor]]:
    """The factors of an entity type that count, in order of declaration: ``only`` these, else all but ``IRRELEVANT``."""
    declared = [f for f in entity.declared if f.width]
    return [f for f in declared if (f in only if only is not None else f not in IRRELEVANT)]


@dataclass(frozen=True)
class Units:
    """Which factors a distance looks at, and the standard deviations that it measures them in.

    Attributes:
        scale: by ``(entity type, factor)``; what has no spread has no weight.
        only: count these factors and no others; None for all but ``IRRELEVANT``.
    """

    scale: Spread
    only: Sequence[type[Factor]] | None = None

    @classmethod
    def checked(
        cls, what: str, sets: Sequence[Levels], scale: Spread | None, factors: Sequence[type[Factor]] | None
    ) -> Units:
        """The units ``scale``, or ``spread(*sets)`` for None.

        Raises:
            LevelError: in the name of the function ``what``, if one of its arguments is of the wrong kind.
        """
        checks.require_levels(what, *sets)
        checks.require_factors(what, factors, *sets)
        if factors is not None and not len(factors):
            raise LevelError(
                f"{what}: factors lists none, so that nothing would be compared; leave it out to compare all"
            )
        if scale is not None:
            _check_scale(what, scale)
        return cls(spread(*sets) if scale is None else scale, factors)

    def factors(self, entity: type[Entity]) -> list[type[Factor]]:
        """The relevant factors of an entity type that have a spread."""
        return [f for f in relevant_factors(entity, self.only) if self.scale.get((entity, f), 0.0) > 0.0]

    def parameters(self, *sets: Levels) -> list[type[Parameter]]:
        """The world parameters of any of the sets that have a spread."""
        known = [p for p in all_parameters(*sets) if self.only is None or p in self.only]
        return [p for p in known if self.scale.get((Parameter, p), 0.0) > 0.0]

    def state(self, levels: Levels, entity: type[Entity]) -> PointSets:
        """Vectors of the entities of one type, as :func:`gather_state`, in these units."""
        factors = self.factors(entity)
        return self._scaled(moments.gather_state(levels, entity, factors), entity, factors)

    def world(self, levels: Levels, parameters: Sequence[type[Parameter]]) -> PointSets:
        """The world parameters of each level, as :func:`gather_parameters`, in these units."""
        return self._scaled(moments.gather_parameters(levels, parameters), Parameter, parameters)

    def _scaled(self, found: PointSets, owner: type, factors: Sequence[type[Factor]]) -> PointSets:
        unit = np.repeat([self.scale[owner, f] for f in factors], [f.width for f in factors])
        if all(f.period is None for f in factors):
            return PointSets(found.counts, found.points / unit)
        periods = np.repeat([np.inf if f.period is None else f.period for f in factors], [f.width for f in factors])
        return PointSets(found.counts, found.points / unit, periods / unit)


def _check_scale(what: str, scale: Any) -> None:
    """Raise :class:`LevelError` in the name of ``what`` unless this maps factors of entity types, and world parameters, to
    finite numbers that are not negative. It may name entity types that the sets lack: units of several pairs do."""
    form = "as segar.metrics.spread(a, b) does"
    if not isinstance(scale, Mapping):
        raise LevelError(f"{what}: scale must map (entity type, factor) to a standard deviation, {form}, not {scale!r}")
    for key, unit in scale.items():
        owner, factor = key if isinstance(key, tuple) and len(key) == 2 else (None, None)
        if not (isinstance(owner, type) and isinstance(factor, type) and issubclass(owner, (Entity, Parameter))):
            raise LevelError(f"{what}: scale is keyed by (entity type, factor), {form}, not by {key!r}")
        if not (issubclass(factor, Parameter) if owner is Parameter else factor in getattr(owner, "declared", ())):
            raise LevelError(f"{what}: scale gives a unit to {factor.__name__} of {owner.__name__}, which has none")
        name = f"{'world' if owner is Parameter else owner.__name__}.{factor.__name__}"
        checks.require_size(what, f"the scale of {name}", unit)


def cut(values: np.ndarray, factor: type[Factor]) -> np.ndarray:
    """Numbers of a factor with a period, as numbers between minus and plus half that period; others unchanged."""
    return values if factor.period is None else wrap(values, factor.period)


def shorter_way(difference: np.ndarray, periods: np.ndarray | None) -> np.ndarray:
    """Differences (components on the last axis), along the shorter way round the circle where a component has a period."""
    if periods is None:
        return difference
    finite = np.isfinite(periods)
    difference = difference.copy()
    difference[..., finite] -= periods[finite] * np.rint(difference[..., finite] / periods[finite])
    return difference


def all_parameters(*sets: Levels) -> list[type[Parameter]]:
    """The world parameters of any of the sets."""
    return list(dict.fromkeys(p for levels in sets for p in levels.layout.parameters))


def spread(*sets: Levels | LevelDistribution) -> Spread:
    """Standard deviation of every factor of every entity type, under the mixture of the given distributions in equal parts.

    A level set that carries its distribution stands for it (by ``SPREAD_SAMPLE`` levels of a fixed seed), and one from
    a file for the distribution that it had when it was saved; one made by hand stands for itself. A vector factor has
    one spread, the root mean square of its components', so that directions in the arena stay comparable. Pass the
    result to :func:`segar.metrics.w2` to measure several pairs in one unit.

    Returns:
        ``{(entity type, factor): standard deviation}``; 0 for what is constant.
    """
    known = [
        # A type too rare for the distribution's sample is measured on the levels themselves.
        {**moments.moments_of_levels(one), **moments.source_moments(one)}
        if isinstance(one, Levels)
        else moments.moments_of_distribution(checks.require_distribution("spread", one))
        for one in sets
    ]
    found: Spread = {}
    for key in dict.fromkeys(key for each in known for key in each):
        means, variances = (np.stack(values) for values in zip(*(m[key] for m in known if key in m), strict=True))
        variance = variances.mean(axis=0) + moments.mean_and_variance(means, key[1].period)[1]
        # What is constant may differ in its last bit after arithmetic; that is no spread.
        variance[variance <= (1e-12 * np.abs(means).max(axis=0)) ** 2] = 0.0
        found[key] = float(np.sqrt(variance.mean()))
    return found
