"""World parameters that rule spaces make: which options are active, and the constants of rules from templates."""

import copyreg
import keyword
from functools import cache
from typing import Any

from segar.errors import RuleError
from segar.language import Flag, Parameter


class Activity(Flag, Parameter):
    """Whether an option of a rule space is active in a level: 1 or 0."""


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
