"""The built-in factors: one class each with its kind of value, default, unit and bounds.

A factor is declared by sub-classing a kind (:class:`Scalar`, :class:`Vector`, :class:`Flag`, :class:`Count`) or another
factor; rules of the parent apply to the child, not the reverse::

    class Temperature(segar.Scalar, default=20.0, unit="degC"): ...
"""

from typing import Any, ClassVar

import numpy as np

from segar.errors import FactorError, did_you_mean
from segar.language.shapes import BaseShape
from segar.language.values import Number, VectorValue

TRUTHS = (bool, np.bool_)
NO_NUMBERS = "bSU"  # kinds of numpy: truths and texts, which float() would take
LARGEST = 1e30
"""The largest size of a number in a level, in any unit: products of several such numbers do not overflow float64."""


class Factor:
    """Base of all factors. Class attributes describe it; calling it casts a value to its kind."""

    width: ClassVar[int] = 0
    """Number of state columns: 1 scalar, flag or count; 2 vector; 0 text, shape or marker."""
    default: ClassVar[Any] = None
    unit: ClassVar[str] = ""
    bounds: ClassVar[tuple[float, float] | None] = None
    period: ClassVar[float | None] = None
    """The number is equal to itself plus this period, as for angles and 2 pi; distances take the shorter way round."""

    def __init_subclass__(
        cls, default: Any = None, unit: str | None = None, bounds: Any = None, period: float | None = None, **rest: Any
    ) -> None:
        if rest:
            raise FactorError(
                f"factor {cls.__name__}: unknown option '{next(iter(rest))}'."
                f"{did_you_mean(next(iter(rest)), ('default', 'unit', 'bounds', 'period'))}"
            )
        super().__init_subclass__()
        if unit is not None:
            cls.unit = unit
        if bounds is not None:
            low, high = bounds
            if not low <= high:
                raise FactorError(f"factor {cls.__name__}: bounds {bounds!r} are reversed")
            cls.bounds = (float(low), float(high))
        if period is not None:
            if cls.width != 1 or not 0 < period < np.inf:
                raise FactorError(
                    f"factor {cls.__name__}: a period is a positive number, and for factors of one number"
                )
            cls.period = float(period)
        if default is not None:
            cls.default = cls.check(default)

    @classmethod
    def check(cls, value: Any) -> Any:
        """Cast ``value`` to what the state stores; raise :class:`FactorError` if it is not of this kind."""
        raise FactorError(f"{cls.__name__} takes no value")

    kind_of_number: ClassVar[str] = "a finite number"
    """What :meth:`is_possible` asks for apart from the bounds, for messages."""

    @classmethod
    def is_possible(cls, values: np.ndarray) -> np.ndarray:
        """Which numbers (float, any shape) the factor can have when an episode starts; bool of the same shape.

        They are finite, of at most :data:`LARGEST` in size, and within the bounds.
        """
        low, high = cls.bounds or (-LARGEST, LARGEST)
        with np.errstate(invalid="ignore"):
            return (np.abs(values) <= LARGEST) & (values >= low) & (values <= high)

    @classmethod
    def possible_values(cls) -> str:
        """What :meth:`is_possible` asks for, in words."""
        within = f" from {cls.bounds[0]:g} to {cls.bounds[1]:g}" if cls.bounds else f", at most {LARGEST:g} in size"
        return f"{cls.kind_of_number}{within}"


class Scalar(Factor):
    """A real number."""

    width = 1
    default = 0.0

    def __new__(cls, value: Any) -> Any:
        if _is_symbol(value):
            return value
        return Number(cls.check(float(value) if isinstance(value, TRUTHS) else value))  # rules may count truths

    @classmethod
    def check(cls, value: Any) -> float:
        try:
            number = float(value)
        except (TypeError, ValueError):
            raise FactorError(f"{cls.__name__} takes a number, not {value!r}") from None
        if np.asarray(value).dtype.kind in NO_NUMBERS:
            raise FactorError(f"{cls.__name__} takes a number, not {value!r}")
        if not np.isfinite(number):
            raise FactorError(f"{cls.__name__} must be finite, not {number!r}")
        return number


class Count(Scalar):
    """A whole number."""

    default = 0
    kind_of_number = "a whole number"

    @classmethod
    def is_possible(cls, values: np.ndarray) -> np.ndarray:
        return super().is_possible(values) & (np.round(values) == values)

    @classmethod
    def check(cls, value: Any) -> float:
        number = super().check(value)
        if number != int(number):
            raise FactorError(f"{cls.__name__} takes a whole number, not {value!r}")
        return number


class Flag(Factor):
    """True or false, stored as 1.0 or 0.0."""

    width = 1
    default = 0.0
    kind_of_number = "0 or 1"

    @classmethod
    def is_possible(cls, values: np.ndarray) -> np.ndarray:
        return (values == 0.0) | (values == 1.0)

    @classmethod
    def possible_values(cls) -> str:
        return cls.kind_of_number

    def __new__(cls, value: Any) -> Any:
        return value if _is_symbol(value) else Number(cls.check(value))

    @classmethod
    def check(cls, value: Any) -> float:
        if isinstance(value, (bool, np.bool_)) or value in (0, 1):
            return float(value)
        raise FactorError(f"{cls.__name__} takes True or False, not {value!r}")


class Vector(Factor):
    """A 2-vector."""

    width = 2
    default = (0.0, 0.0)

    def __new__(cls, value: Any) -> Any:
        if isinstance(value, VectorValue):
            return VectorValue(value.x, value.y)
        if _is_symbol(value):
            return VectorValue(value, value)
        if isinstance(value, (list, tuple)) and len(value) == 2 and any(map(_is_symbol, value)):
            return VectorValue(*value)
        return VectorValue(*cls.check(value))

    @classmethod
    def check(cls, value: Any) -> tuple[float, float]:
        try:
            array = np.asarray(value, dtype=float)
        except (TypeError, ValueError):
            raise FactorError(f"{cls.__name__} takes two numbers, not {value!r}") from None
        if array.shape != (2,):
            raise FactorError(f"{cls.__name__} takes two numbers, not shape {array.shape}")
        if any(np.asarray(one).dtype.kind in NO_NUMBERS for one in value):
            raise FactorError(f"{cls.__name__} takes two numbers, not {value!r}")
        if not np.isfinite(array).all():
            raise FactorError(f"{cls.__name__} must be finite, not {value!r}")
        return float(array[0]), float(array[1])


class Text(Factor):
    """Text that belongs to an entity type; no rule changes it."""

    default = ""

    @classmethod
    def check(cls, value: Any) -> str:
        return str(value)


class Marker(Factor):
    """A factor without a value: an entity has it or not, and rules can take it."""

    @classmethod
    def check(cls, value: Any) -> None:
        if value not in (None, True):
            raise FactorError(f"{cls.__name__} is a marker and takes no value (got {value!r})")


def _is_symbol(value: Any) -> bool:
    return hasattr(value, "select")


def all_subclasses(cls: type) -> list[type]:
    """The classes that inherit from one, in order of definition, each before those that inherit from it."""
    found: dict[type, None] = {}
    for child in cls.__subclasses__():
        found |= {child: None} | dict.fromkeys(all_subclasses(child))
    return list(found)


def concrete_factors() -> list[type[Factor]]:
    """All factors defined so far, the user's included, in order of definition, without the kinds themselves."""
    return [one for one in all_subclasses(Factor) if one not in (Scalar, Count, Flag, Vector, Text, Marker)]


class Position(Vector, unit="m"): ...


class Velocity(Vector, unit="m/s"): ...


class Acceleration(Vector, unit="m/s^2"): ...


class Drag(Vector, unit="m/s^2"):
    """The part of an object's acceleration that is kinetic friction."""


class Visible(Flag, default=True): ...


class Alive(Flag, default=True): ...


class Done(Flag, default=False): ...


class InfiniteEnergy(Flag, default=False): ...


class Mobile(Flag, default=True): ...


class Order(Count, default=0):
    """Height in the pile: the lowest order lies on top."""


class Size(Scalar, default=1.0, unit="m"):
    """Diameter; a circle's radius is half of it."""

    kind_of_number = "a positive number"

    @classmethod
    def is_possible(cls, values: np.ndarray) -> np.ndarray:
        return super().is_possible(values) & (values > 0.0)


class Mass(Scalar, default=1.0, unit="kg"):
    """Mass; no level starts with a negative one."""

    kind_of_number = "a number that is not negative"

    @classmethod
    def is_possible(cls, values: np.ndarray) -> np.ndarray:
        return super().is_possible(values) & (values >= 0.0)


class Density(Scalar, default=1.0, unit="kg/m^2"): ...


class Charge(Scalar, default=0.0): ...


class Magnetism(Scalar, default=0.0): ...


class StoredEnergy(Scalar, default=0.0): ...


class Heat(Scalar, default=0.0): ...


class Friction(Scalar, default=0.0):
    """Kinetic friction coefficient."""


class Floor(Marker):
    """Marks what objects roll over."""


class Collides(Marker):
    """Marks what bounces off walls and off others that collide."""


class Consumes(Marker):
    """Marks what swallows objects that it contains."""


class Label(Text): ...


class ID(Text): ...


class Shape(Factor):
    """The outline of a thing; its values are the classes of :mod:`segar.language.shapes`."""

    @classmethod
    def check(cls, value: Any) -> Any:
        if isinstance(value, type) and issubclass(value, BaseShape):
            value = value()  # type: ignore[call-arg] - each shape has a default size
        if not isinstance(value, BaseShape):
            raise FactorError(f"Shape takes a shape such as Circle(0.2), not {value!r}")
        return value
