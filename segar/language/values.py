"""What a factor's value can be, and the arithmetic that a rule may use.

A rule sees numbers and 2-vectors. The same arithmetic runs on floats (:class:`Number`, the interpreter) and on
symbols (:class:`segar.language.symbols.Symbol`, the compiler); :class:`VectorValue` holds two of either.
"""

from __future__ import annotations

import math
import operator
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import cache, partialmethod
from typing import Any

from segar.errors import RuleError
from segar.support import mathematics


@dataclass(frozen=True)
class Source:
    """Where a value was read from: which argument of the rule, and which factor of it."""

    argument: int
    factor: type


def binary(operation: str, swapped: bool = False) -> Callable[[Any, Any], Any]:
    """The method of an operator with two operands, of which the object is the second one if they are ``swapped``."""
    if swapped:
        return lambda self, other: self._apply(operation, other, self)
    return lambda self, other: self._apply(operation, self, other)


class Arithmetic:
    """Python's operators of numbers, vectors and symbols."""

    __slots__ = ()

    def _apply(self, operation: str, *operands: Any) -> Any:
        """The result of an operation; NotImplemented where another operand has to know."""
        raise NotImplementedError

    __add__, __radd__ = binary("add"), binary("add", swapped=True)
    __sub__, __rsub__ = binary("sub"), binary("sub", swapped=True)
    __mul__, __rmul__ = binary("mul"), binary("mul", swapped=True)
    __truediv__, __rtruediv__ = binary("div"), binary("div", swapped=True)

    def __neg__(self) -> Any:
        return self._apply("neg", self)

    def __abs__(self) -> Any:
        return self._apply("abs", self)

    abs = __abs__


class ScalarArithmetic(Arithmetic):
    """What numbers and symbols have beside the operators: powers and elementary functions."""

    __slots__ = ()
    norm = Arithmetic.__abs__

    def __pow__(self, exponent: Any) -> Any:
        power = literal_power(self, exponent)
        return self._apply("pow", self, exponent) if power is None else power

    def __rpow__(self, base: Any) -> Any:
        return self._apply("pow", base, self)

    def _call(self, function: str, *others: Any) -> Any:
        """The function of this and another operand, which is asked where this one cannot, as Python's operators do it."""
        for operand in filter(lambda one: isinstance(one, ScalarArithmetic), (self, *others)):
            result = operand._apply(function, self, *others)
            if result is not NotImplemented:
                return result
        raise TypeError(f"{function} takes numbers, not {type(others[-1]).__name__}")

    sign = partialmethod(_call, "sign")
    sqrt = partialmethod(_call, "sqrt")
    exp = partialmethod(_call, "exp")
    log = partialmethod(_call, "log")
    sin = partialmethod(_call, "sin")
    cos = partialmethod(_call, "cos")
    tan = partialmethod(_call, "tan")
    tanh = partialmethod(_call, "tanh")
    arctan2 = partialmethod(_call, "arctan2")
    hypot = partialmethod(_call, "hypot")


class Number(ScalarArithmetic, float):
    """A float that divides as IEEE 754 does (1/0 is inf, 0/0 is nan) and remembers the factor that it was read from."""

    source: Source | None = None

    @classmethod
    def of(cls, value: float, source: Source | None = None) -> Number:
        number = cls(value)
        number.source = source
        return number

    def _apply(self, operation: str, *operands: Any) -> Any:
        if not all(map(_is_number, operands)):
            return NotImplemented
        return Number(float_function(operation)(*map(float, operands)))

    def __pos__(self) -> Number:
        return Number(float(self))

    def __repr__(self) -> str:
        return float.__repr__(self)


class VectorValue(Arithmetic):
    """A 2-vector of numbers or symbols. Operations are element-wise; a scalar acts on both components.

    It is the value type; the factor base class of the same role is :class:`segar.language.factors.Vector`.
    """

    __array_ufunc__ = None
    __slots__ = ("source", "x", "y")

    def __init__(self, x: Any, y: Any, source: Source | None = None) -> None:
        self.x, self.y = _as_scalar(x), _as_scalar(y)
        self.source = source

    def _apply(self, operation: str, *operands: Any) -> VectorValue:
        function = getattr(operator, "truediv" if operation == "div" else operation)
        vectors = [_as_vector(operand) for operand in operands]
        return VectorValue(function(*(v.x for v in vectors)), function(*(v.y for v in vectors)))

    __radd__ = Arithmetic.__add__  # a number stands behind a vector in the source of a kernel
    __rmul__ = Arithmetic.__mul__

    def __pow__(self, exponent: float) -> VectorValue:
        return VectorValue(self.x**exponent, self.y**exponent)

    def sign(self) -> VectorValue:
        return VectorValue(self.x.sign(), self.y.sign())

    def dot(self, other: Any) -> Any:
        o = _as_vector(other)
        return self.x * o.x + self.y * o.y

    def norm(self) -> Any:
        """Euclidean length."""
        return (self.x * self.x + self.y * self.y).sqrt()

    def unit_vector(self) -> VectorValue:
        """The vector divided by its length: nan at zero."""
        return self / self.norm()

    def tangent_vector(self) -> VectorValue:
        """The vector turned by +90 degrees: (-y, x)."""
        return VectorValue(-self.y, self.x)

    def __getitem__(self, index: int) -> Any:
        if index not in (0, 1):
            raise IndexError(f"a vector has components 0 and 1, not {index!r}")
        return self.y if index else self.x

    def __iter__(self) -> Iterator[Any]:
        return iter((self.x, self.y))

    def __len__(self) -> int:
        return 2

    def __eq__(self, other: object) -> Any:
        o = _as_vector(other)
        return (self.x == o.x) & (self.y == o.y)

    def __ne__(self, other: object) -> Any:
        equal = self == other
        return not equal if isinstance(equal, bool) else equal.negate()

    __hash__ = None  # type: ignore[assignment]

    def __bool__(self) -> bool:
        raise RuleError("a vector is neither true nor false: test its norm(), or one component")

    def __repr__(self) -> str:
        return f"Vector({self.x!r}, {self.y!r})"


def sqrt(x: Any) -> Any:
    """Square root; nan below zero."""
    return _as_scalar(x).sqrt()


def exp(x: Any) -> Any:
    """Natural exponential."""
    return _as_scalar(x).exp()


def log(x: Any) -> Any:
    """Natural logarithm; -inf at zero, nan below."""
    return _as_scalar(x).log()


def sin(x: Any) -> Any:
    """Sine of an angle in radians."""
    return _as_scalar(x).sin()


def cos(x: Any) -> Any:
    """Cosine of an angle in radians."""
    return _as_scalar(x).cos()


def tan(x: Any) -> Any:
    """Tangent of an angle in radians."""
    return _as_scalar(x).tan()


def tanh(x: Any) -> Any:
    """Hyperbolic tangent."""
    return _as_scalar(x).tanh()


def arctan2(y: Any, x: Any) -> Any:
    """Angle in radians of the point (x, y), in [-pi, pi]."""
    return _as_scalar(y).arctan2(x)


def hypot(x: Any, y: Any) -> Any:
    """Length of the vector (x, y), without overflow within."""
    return _as_scalar(x).hypot(y)


def literal_power(x: Any, exponent: Any) -> Any:
    """x to the power of 2, 1, 0.5 or -1 where a rule's source has this number: a product, a root, a quotient; else None.

    A :class:`Number` was computed, in a kernel during a step, and has no such rule.
    """
    if type(exponent) is Number or not _is_number(exponent):
        return None
    if exponent == 2:
        return x * x
    if exponent == 1:
        return +x
    if exponent == 0.5:
        return x.sqrt()
    return 1.0 / x if exponent == -1 else None


def where(condition: Any, yes: Any, no: Any) -> Any:
    """``yes`` if the condition holds, else ``no``; both are computed, nothing forks."""
    if isinstance(yes, VectorValue) or isinstance(no, VectorValue):
        a, b = _as_vector(yes), _as_vector(no)
        return VectorValue(where(condition, a.x, b.x), where(condition, a.y, b.y))
    if hasattr(condition, "select"):
        return condition.select(yes, no)
    chosen = yes if condition else no
    return chosen if isinstance(chosen, bool) else _as_scalar(chosen)


def minimum(a: Any, b: Any) -> Any:
    """The smaller of two numbers, element-wise."""
    if isinstance(a, VectorValue) or isinstance(b, VectorValue):
        a, b = _as_vector(a), _as_vector(b)
        return VectorValue(minimum(a.x, b.x), minimum(a.y, b.y))
    return where(a < b, a, b)


def maximum(a: Any, b: Any) -> Any:
    """The larger of two numbers, element-wise."""
    return -minimum(-a, -b)


def _is_number(value: Any) -> bool:
    return issubclass(type(value), (int, float))  # isinstance would believe a symbol, which says that it is a number


@cache
def float_function(operation: str) -> Callable[..., Any]:
    """The function of an operation on floats, which raises for none of them: the same bits on all machines."""
    own = {name: getattr(mathematics, name) for name in mathematics.__all__}
    own |= {"div": _divide, "sqrt": _sqrt, "sign": _sign}
    return own[operation] if operation in own else getattr(operator, operation)


def _sqrt(x: float) -> float:
    return math.sqrt(x) if x >= 0 else math.nan


def _sign(x: float) -> float:
    return (x > 0) - (x < 0) or x  # of zeros the sign stays, and nan


def _divide(a: float, b: float) -> float:
    if b != 0.0:
        return a / b
    if a == 0.0 or math.isnan(a) or math.isnan(b):
        return math.nan
    return math.copysign(math.inf, a) * math.copysign(1.0, b)


def _as_scalar(x: Any) -> Any:
    return Number(x) if _is_number(x) and type(x) is not Number else x


def _as_vector(value: Any) -> VectorValue:
    if isinstance(value, VectorValue):
        return value
    if isinstance(value, (list, tuple)) or getattr(value, "shape", None) == (2,):
        x, y = value
        return VectorValue(float(x) if hasattr(x, "dtype") else x, float(y) if hasattr(y, "dtype") else y)
    return VectorValue(value, value)


ZERO = VectorValue(0.0, 0.0)
