"""What templates ask of their arguments: names, factors, types of tiles and constants."""

from typing import Any

import numpy as np

from segar.errors import RuleError
from segar.language import Count, Factor, Parameter, Scalar, Tile
from segar.noise import Noise, as_noise
from segar.rules.constants import activity, constant


def made_constant(
    option: str, what: str, default: float, unit: str = "", bounds: tuple[float, float] | None = None
) -> type[Parameter]:
    """The constant of an option: ``wind_strength`` for the strength of ``wind``; raises :class:`RuleError` for a wrong name."""
    activity(option)
    return constant(f"{option}_{what}", default, unit, bounds)


def require_numbers(option: str, *factors: Any) -> None:
    """Raise :class:`RuleError` unless all are factors that are one number."""
    for factor in factors:
        if not (isinstance(factor, type) and issubclass(factor, Factor) and factor.width == 1):
            raise RuleError(f"the template '{option}' takes factors that are numbers, such as Charge, not {factor!r}")


def require_scalars(option: str, *factors: Any) -> None:
    """Raise :class:`RuleError` unless all are factors that are one real number, neither flags nor whole numbers."""
    for factor in factors:
        if not (isinstance(factor, type) and issubclass(factor, Scalar) and not issubclass(factor, Count)):
            raise RuleError(
                f"the template '{option}' takes factors that are real numbers, such as Charge, not {factor!r}"
            )


def require_tiles(option: str, kind: Any) -> None:
    """Raise :class:`RuleError` unless it is a type of tiles."""
    if not (isinstance(kind, type) and issubclass(kind, Tile)):
        raise RuleError(f"the template '{option}': {kind!r} is no type of tiles, such as SandTile")


def require_values(option: str, what: str, given: Any, factor: type[Factor]) -> None:
    """Raise :class:`RuleError` unless a factor can have the value, or all values of the distribution, that are given."""
    law = given if isinstance(given, Noise) else as_noise(factor.check(given))
    values, masses = law.atoms
    values = values if abs(masses.sum() - 1) < 1e-9 else np.array(law.support)
    if not factor.is_possible(values).all():
        raise RuleError(
            f"the template '{option}': the {what} {given!r} sets {factor.__name__} to numbers from {values.min():g} to"
            f" {values.max():g}; it must be {factor.possible_values()}"
        )
