"""Numbers of levels, and how questions state them in words: with six digits, and units."""

from collections.abc import Iterable
from typing import Any

import numpy as np

from segar.language import Factor, Parameter
from segar.levels import Levels


def number(value: Any) -> str:
    """A number with six digits at most, as :func:`segar.levels.rules_in_words` has them; never ``-0``."""
    return f"{float(value) + 0.0:.6g}"


def vector(values: Iterable[Any]) -> str:
    """Numbers in brackets."""
    return f"({', '.join(map(number, values))})"


def with_unit(value: Any, factor: type[Factor]) -> str:
    """The value of a factor, one or two numbers, with its unit."""
    values = np.atleast_1d(value)
    text = number(values[0]) if len(values) == 1 else vector(values)
    return f"{text} {factor.unit}".rstrip()


def parameter_value(level: Levels, parameter: type[Parameter]) -> float:
    """The value of a world parameter in a single level."""
    return float(level.parameters[0, level.layout.parameters.index(parameter)])


def rounded(value: Any) -> float:
    """A number with three digits, which words can state in full."""
    return float(f"{float(value):.3g}") + 0.0
