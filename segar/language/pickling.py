"""Functions of rules and tasks in pickles: by name where their module has them, otherwise by their code.

Python pickles functions by name alone. The name of a decorated function leads to its rule, and a function that is defined
within another one has none.
"""

import dataclasses
import functools
import pickle
import sys
from collections.abc import Callable, Mapping
from inspect import isfunction
from types import FunctionType
from typing import Any

from segar.errors import RuleError, SegarError
from segar.language.signature import code_place, hints_of
from segar.support import named_object


class ByName:
    """A dataclass with a function, by which it is called and named.

    Pickles hold it by its name where its module has it by that name, else by its fields with :func:`packed` functions.
    """

    function: Callable[..., Any]

    def __call__(self, *arguments: Any) -> Any:
        return self.function(*arguments)

    @property
    def name(self) -> str:
        return self.function.__name__

    def __reduce__(self) -> tuple[Any, ...]:
        if _of_name(self.function) is self:
            return named_object, (f"{self.function.__module__}:{self.function.__qualname__}",)
        assert dataclasses.is_dataclass(self)
        fields = {field.name: packed(getattr(self, field.name)) for field in dataclasses.fields(self)}
        return _made, (type(self), (), fields)


def packed(value: Any) -> Any:
    """The value with its functions, and those in tuples, mappings and partials, as pickles can hold them.

    Raises:
        SegarError: a function that has no name of its own refers to something that cannot be pickled.
    """
    if isinstance(value, tuple) and type(value) is tuple:
        return tuple(map(packed, value))
    if isinstance(value, Mapping):
        return {key: packed(part) for key, part in value.items()}
    if isinstance(value, functools.partial):
        return _Reduced(_made, (functools.partial, packed((value.func, *value.args)), packed(value.keywords)))
    if not isfunction(value):
        return value
    found = _of_name(value)
    if found is value:
        return value
    if getattr(found, "function", None) is value:  # of the rule or relation that this name leads to
        return _Reduced(getattr, (found, "function"))
    return _Reduced(pickle.loads, (_code(value),))


@dataclasses.dataclass(frozen=True)
class _Reduced:
    """Stands in a pickle for what a call returns, which is what the pickle then holds."""

    function: Any
    arguments: tuple[Any, ...]

    def __reduce__(self) -> tuple[Any, tuple[Any, ...]]:
        return self.function, self.arguments


def _made(kind: type, arguments: tuple[Any, ...], fields: Mapping[str, Any]) -> Any:
    return kind(*arguments, **fields)


def _of_name(function: Any) -> Any:
    """What the name of a function leads to; None if it leads nowhere."""
    found: Any = sys.modules.get(function.__module__)
    for part in function.__qualname__.split("."):
        found = getattr(found, part, None)
    return found


def _code(function: FunctionType) -> bytes:
    """A pickle of the function's code, and of what it refers to."""
    import cloudpickle

    copy = FunctionType(
        function.__code__, function.__globals__, function.__name__, function.__defaults__, function.__closure__
    )
    functools.update_wrapper(copy, function)
    del copy.__wrapped__
    copy.__kwdefaults__ = function.__kwdefaults__
    try:
        copy.__annotations__ = hints_of(function)  # strings, whose module does not travel with the code
    except RuleError:  # a function that is no rule may have any hints, and nobody reads them
        copy.__annotations__ = {}
    try:
        return cloudpickle.dumps(copy)
    except Exception as cause:  # what a function refers to may refuse in any way
        raise SegarError(
            f"{code_place(function)} cannot be pickled: {cause}; define it at the top level of a module, or let it refer to"
            " nothing of that kind"
        ) from cause
