"""World parameters that rule spaces make: which options are active, and the constants of rules from templates."""

import copyreg
import keyword
from functools import cache
from typing import Any

import numpy as np

from segar.errors import FactorError, RuleError
from segar.language import Parameter


class Activity(Parameter):
    """Whether an option of a rule space is active in a level: 1 or 0."""

    kind_of_number = "0 or 1"

    @classmethod
    def is_possible(cls, values: np.ndarray) -> np.ndarray:
        return (values == 0.0) | (values == 1.0)

    @classmethod
    def possible_values(cls) -> str:
        return cls.kind_of_number

    @classmethod
    def check(cls, value: Any) -> float:
        if isinstance(value, (bool, np.bool_)) or value in (0, 1):
            return float(value)
        raise FactorError(f"{cls.__name__} takes True or False, not {value!r}")


class _Made(type):
    """The class of parameter classes that functions of this module make; their pickles say how to make them again."""


def _made_again(cls: Any) -> tuple[Any, ...]:
    return (_activity if issubclass(cls, Activity) else _constant), cls.made_of


copyreg.pickle(_Made, _made_again)


def activity(option: str) -> type[Activity]:
    """The parameter that says whether the option of this name is active: ``portal_active`` for ``portal``.

    Raises:
        RuleError: the name is not one that a variable could have.
    """
    if not isinstance(option, str) or not option.isidentifier() or keyword.iskeyword(option):
        raise RuleError(f"an option of a rule space needs a name such as 'wind' or 'strong_wind', not {option!r}")
    return _activity(option)


@cache
def _activity(option: str) -> type[Activity]:
    content = {"__module__": __name__, "__doc__": f"Whether {option} is active in a level.", "made_of": (option,)}
    return _Made(f"{option}_active", (Activity,), content)  # type: ignore[return-value]


def constant(name: str, default: float, unit: str = "", bounds: tuple[float, float] | None = None) -> type[Parameter]:
    """A world parameter of that name; the same class whenever it is asked for in the same way.

    Raises:
        FactorError: default, unit or bounds do not suit a parameter.
    """
    return _constant(name, float(default), unit, bounds)


@cache
def _constant(name: str, default: float, unit: str, bounds: tuple[float, float] | None) -> type[Parameter]:
    made_of = (name, default, unit, bounds)
    content = {"__module__": __name__, "__doc__": f"A constant of a rule, {name}.", "made_of": made_of}
    return _Made(name, (Parameter,), content, default=default, unit=unit, bounds=bounds)  # type: ignore[return-value]
