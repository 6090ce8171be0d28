"""Levels as sets of vectors: which entities and factors a distance looks at, and in which units."""

from collections.abc import Iterable, Sequence

import numpy as np

from segar.language import Acceleration, Alive, Density, Done, Drag, Entity, Factor, Order, Parameter, Visible
from segar.levels import (
    LevelDistribution,
    Levels,
    PointSets,
    gather_parameters,
    gather_state,
    mean_and_variance,
    moments_of_distribution,
    moments_of_levels,
    require_distribution,
    require_factors,
    require_levels,
    require_units,
    source_moments,
)
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


def weighed_factors(
    entity: type[Entity], scale: Spread, only: Sequence[type[Factor]] | None = None
) -> list[type[Factor]]:
    """The relevant factors of an entity type that have a spread; those without have no weight."""
    return [f for f in relevant_factors(entity, only) if scale.get((entity, f), 0.0) > 0.0]


def weighed_parameters(
    sets: Iterable[Levels], scale: Spread, only: Sequence[type[Factor]] | None = None
) -> list[type[Parameter]]:
    """The world parameters of any of the sets that have a spread: ``only`` these, else all."""
    known = all_parameters(*sets)
    return [p for p in known if scale.get((Parameter, p), 0.0) > 0.0 and (only is None or p in only)]


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


def checked_units(
    what: str, sets: Sequence[Levels], scale: Spread | None, factors: Sequence[type[Factor]] | None
) -> Spread:
    """The units of factors: ``scale``, or ``spread(*sets)`` for None.

    Raises:
        LevelError: in the name of the function ``what``, if one of its arguments is of the wrong kind.
    """
    require_levels(what, *sets)
    require_factors(what, factors, *sets)
    require_units(what, scale)
    return spread(*sets) if scale is None else scale


def spread(*sets: Levels | LevelDistribution) -> Spread:
    """Standard deviation of every factor of every entity type, under the mixture of the given distributions in equal parts.

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
        # A type too rare for the distribution's sample is measured on the levels themselves.
        moments.append(
            {**moments_of_levels(one), **source_moments(one)}
            if isinstance(one, Levels)
            else moments_of_distribution(one)
        )
    found: Spread = {}
    for key in dict.fromkeys(key for known in moments for key in known):
        means, variances = (np.stack(values) for values in zip(*(m[key] for m in moments if key in m), strict=True))
        variance = variances.mean(axis=0) + mean_and_variance(means, key[1].period)[1]
        # What is constant may differ in its last bit after arithmetic; that is no spread.
        variance[variance <= (1e-9 * np.abs(means).max(axis=0)) ** 2] = 0.0
        found[key] = float(np.sqrt(variance.mean()))
    return found
