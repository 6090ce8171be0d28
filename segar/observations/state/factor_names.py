"""Factors by their names, for configurations."""

from collections.abc import Iterable
from typing import Any

from segar.errors import FactorError, did_you_mean
from segar.language import Factor, concrete_factors


def factors_of(where: str, given: Iterable[str | type[Factor]]) -> tuple[type[Factor], ...]:
    """The factor classes that are given by class or by name.

    Raises:
        FactorError: one is no factor, has no number, or no factor is called so; ``where`` says who asks.
    """
    if isinstance(given, str):
        given = [given]
    return tuple(dict.fromkeys(_factor(where, one) for one in given))


def _factor(where: str, given: Any) -> type[Factor]:
    if isinstance(given, str):
        by_name = {factor.__name__: factor for factor in concrete_factors()}  # of several, the one defined last
        if given not in by_name:
            raise FactorError(f"{where}: no factor is called '{given}'.{did_you_mean(given, by_name)}")
        given = by_name[given]
    if not (isinstance(given, type) and issubclass(given, Factor)):
        raise FactorError(f"{where}: {given!r} is not a factor")
    if not given.width:
        raise FactorError(f"{where}: {given.__name__} is not a number, so that no state shows it")
    return given
