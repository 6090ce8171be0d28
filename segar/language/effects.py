"""The effects of rules and how they combine: Aggregate, Differential, SetFactor.

``SetFactor`` beats ``Aggregate`` beats ``Differential``; aggregates on one factor add up and forget the previous
value; differentials add up, are scaled by the time step and added to the previous value (paper, section on rules).
"""

from __future__ import annotations

from typing import Any, ClassVar, Generic, TypeVar

from segar.errors import RuleError
from segar.language.values import Source, VectorValue

F = TypeVar("F")


class Effect(Generic[F]):
    """An effect of a rule on one factor of one of its arguments.

    Args:
        target: the argument's factor that changes, as the rule received it.
        value: the new value or the change; of a vector factor a vector, 0 for the zero vector, or a number that is computed of
            factors, which counts for both components, as in the paper's listings.
    """

    factor: ClassVar[type]
    kind: ClassVar[type[Effect]]
    _bound: ClassVar[dict[Any, type[Effect]]] = {}

    def __class_getitem__(cls, factor: Any) -> Any:
        if isinstance(factor, TypeVar):
            return super().__class_getitem__(factor)  # type: ignore[misc]
        key = (cls, factor)
        if key not in Effect._bound:
            name = f"{cls.__name__}[{getattr(factor, '__name__', factor)}]"
            Effect._bound[key] = type(name, (cls,), {"factor": factor, "kind": cls, "__module__": cls.__module__})
        return Effect._bound[key]

    def __init__(self, target: Any, value: Any) -> None:
        if not hasattr(type(self), "factor"):
            raise RuleError(
                f"{type(self).__name__} needs its factor: write {type(self).__name__}[SomeFactor](old, new)"
            )
        source = getattr(target, "source", None)
        if source is None:
            raise RuleError(
                f"the first argument of {type(self).__name__} must be the factor that changes, as the rule received it"
                f" (got a {type(target).__name__}, which is computed)"
            )
        if getattr(source.factor, "width", 1) == 0:
            raise RuleError(f"{type(self).__name__} was given {source.factor.__name__}, a text, which no rule changes")
        if not issubclass(source.factor, self.factor) and not issubclass(self.factor, source.factor):
            raise RuleError(
                f"{type(self).__name__} was given a {source.factor.__name__} to change, not a {self.factor.__name__}"
            )
        if getattr(source.factor, "width", 1) == 2 and not isinstance(value, VectorValue):
            value = _as_vector(value, type(self).__name__)
        elif getattr(source.factor, "width", 1) == 1 and isinstance(value, VectorValue):
            raise RuleError(f"{type(self).__name__} was given a vector for a scalar factor")
        self.target: Source = source
        self.value = value

    def __repr__(self) -> str:
        return f"{type(self).__name__}({self.value!r})"


def _as_vector(value: Any, name: str) -> VectorValue:
    if isinstance(value, (list, tuple)) and len(value) == 2:
        return VectorValue(value[0], value[1])
    if not isinstance(value, (list, tuple)) and (type(value) not in (int, float) or value == 0):
        return VectorValue(value, value)
    what = f"{len(value)} numbers" if isinstance(value, (list, tuple)) else "a number"
    raise RuleError(f"{name} was given {what} for a vector factor; give both components, as in {name}(old, (x, y))")


class Aggregate(Effect[F]):
    """The factor becomes the sum of all aggregates on it; its previous value is forgotten."""


class Differential(Effect[F]):
    """The factor grows by the sum of all differentials on it, times the time step."""


class SetFactor(Effect[F]):
    """The factor becomes this value; aggregates and differentials on it are ignored."""
