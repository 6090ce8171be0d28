"""Checks of what measures are given: level sets, distributions, generators and factors."""

from collections.abc import Iterable
from numbers import Real
from typing import Any

import numpy as np

from segar.errors import LevelError, SegarError, did_you_mean
from segar.language import Factor
from segar.levels.distribution import LevelDistribution
from segar.levels.level_set import Levels
from segar.support import is_whole


def require_levels(what: str, *sets: object) -> None:
    """Raise :class:`LevelError` in the name of the function ``what`` unless all are level sets."""
    for levels in sets:
        if not isinstance(levels, Levels):
            raise LevelError(
                f"{what} takes level sets (segar.Levels); a {type(levels).__name__} is not supported."
                " Of a distribution, take levels: distribution.sample(n, seed=0, split='test')"
            )


def require_distribution(what: str, given: object) -> LevelDistribution:
    """The level distribution that is given; else raise :class:`LevelError` in the name of the function ``what``."""
    if not isinstance(given, LevelDistribution):
        raise LevelError(f"{what} needs a level distribution (segar.LevelDistribution), not a {type(given).__name__}")
    return given


def require_generator(what: str, rng: object) -> None:
    """Raise :class:`SegarError` in the name of the function ``what`` unless it is a random generator of numpy."""
    if not isinstance(rng, np.random.Generator):
        raise SegarError(f"{what}: rng must be a generator such as np.random.default_rng(0), not {rng!r}")


def require_count(what: str, name: str, value: object, least: int) -> None:
    """Raise :class:`LevelError` in the name of the function ``what`` unless it is given a whole number of ``name``, at least
    ``least``."""
    if not is_whole(value) or value < least:
        raise LevelError(
            f"{what} needs at least {least} {name}, not {value!r}{'' if is_whole(value) else ': a whole number'}"
        )


def require_size(what: str, name: str, value: object) -> None:
    """Raise :class:`LevelError` in the name of the function ``what`` unless ``value`` is a finite number of at least 0."""
    if isinstance(value, (bool, np.bool_)) or not isinstance(value, Real) or not 0 <= float(value) < np.inf:
        raise LevelError(f"{what}: {name} must be a finite number of at least 0, not {value!r}")


def require_factors(what: str, factors: Any, *sets: Any) -> None:
    """Raise :class:`LevelError` in the name of the function ``what`` unless ``factors`` is None or lists factors (or world
    parameters) that some entity (or world) of the sets or distributions has."""
    if factors is None:
        return
    if isinstance(factors, (str, type)) or not isinstance(factors, Iterable):
        raise LevelError(f"{what}: factors must be a list of factor classes such as [Position], not {factors!r}")
    known: set[type] = set()
    for one in sets:
        known |= {*one.layout.parameters, *(f for t in one.layout.types for f in t.declared if f.width)}
    for factor in factors:
        if not (isinstance(factor, type) and issubclass(factor, Factor)):
            raise LevelError(f"{what}: factors are classes such as segar.Position, not {factor!r}")
        if factor not in known:
            near = did_you_mean(factor.__name__, [f.__name__ for f in known])
            raise LevelError(f"{what}: no entity here has the factor {factor.__name__}.{near}")
