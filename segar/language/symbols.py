"""Scalar expressions: what a rule computes with while it is traced.

A :class:`Symbol` is a node of an expression graph. Nodes are interned, so equal expressions are one object and the
generated code computes them once. Constants fold; nothing else is simplified (0 * x stays, since x may be nan or inf).
"""

from __future__ import annotations

import math
import struct
import weakref
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import partialmethod
from typing import Any

from segar.errors import RuleError
from segar.language.values import Arithmetic, Number, Source, VectorValue, literal_power, python_function

_interned: weakref.WeakValueDictionary[Any, Symbol] = weakref.WeakValueDictionary()
_deciders: list[Callable[[Symbol], bool]] = []  # the last one decides what a condition is on the path being traced

TRUTHS = frozenset({"lt", "le", "gt", "ge", "eq", "ne", "and", "or", "not", "relation"})

NO_NUMPY = "a rule cannot call numpy; use arithmetic, or segar.language.sqrt, where, minimum ..."


class Symbol(Arithmetic):
    """A node: an operation and its operands. Made by :func:`make`, never directly."""

    __array_ufunc__ = None
    __slots__ = ("__weakref__", "args", "op")
    op: str
    args: tuple[Any, ...]

    def __reduce__(self) -> tuple[Any, ...]:
        return make, (self.op, *self.args)

    def _apply(self, operation: str, *operands: Any) -> Any:
        if any(isinstance(operand, VectorValue) for operand in operands):
            return NotImplemented
        for operand in operands:
            if operand is None or isinstance(operand, str):
                raise RuleError(f"a factor cannot be combined or compared with {operand!r}")
        return make(operation, *map(as_symbol, operands))

    @property
    def is_truth(self) -> bool:
        return self.op in TRUTHS or (self.op == "const" and isinstance(self.args[0], bool))

    @property
    def source(self) -> Source | None:
        """The argument and factor that this symbol reads, if it is a plain read of a scalar factor."""
        return Source(self.args[0], self.args[1]) if self.op == "load" else None

    def __bool__(self) -> bool:
        if self.op == "const":
            return bool(self.args[0])
        condition = self if self.is_truth else self != 0.0
        if not _deciders:
            raise RuleError("a symbolic condition was tested outside a rule")
        return _deciders[-1](condition)

    def __pow__(self, exponent: Any) -> Any:
        power = literal_power(self, exponent)
        return self._apply("pow", self, exponent) if power is None else power

    def __rpow__(self, base: Any) -> Any:
        return self._apply("pow", base, self)

    def __pos__(self) -> Symbol:
        return self

    norm = Arithmetic.__abs__

    def _call(self, function: str) -> Symbol:
        return make(function, self)

    sign = partialmethod(_call, "sign")
    sqrt = partialmethod(_call, "sqrt")
    exp = partialmethod(_call, "exp")
    log = partialmethod(_call, "log")
    sin = partialmethod(_call, "sin")
    cos = partialmethod(_call, "cos")
    tan = partialmethod(_call, "tan")
    tanh = partialmethod(_call, "tanh")

    def arctan2(self, other: Any) -> Any:
        return self._apply("arctan2", self, other)

    def __rarctan2__(self, other: Any) -> Any:
        return self._apply("arctan2", other, self)

    def hypot(self, other: Any) -> Any:
        return self._apply("hypot", self, other)

    def __rhypot__(self, other: Any) -> Any:
        return self._apply("hypot", other, self)

    def select(self, yes: Any, no: Any) -> Symbol:
        condition = self if self.is_truth else self != 0.0
        return make("select", condition, as_symbol(yes), as_symbol(no))

    def __lt__(self, other: Any) -> Any:
        return self._apply("lt", self, other)

    def __le__(self, other: Any) -> Any:
        return self._apply("le", self, other)

    def __gt__(self, other: Any) -> Any:
        return self._apply("lt", other, self)

    def __ge__(self, other: Any) -> Any:
        return self._apply("le", other, self)

    def __eq__(self, other: object) -> Any:
        return self._apply("eq", self, other)

    def __ne__(self, other: object) -> Any:
        return self._apply("ne", self, other)

    def __and__(self, other: Any) -> Any:
        return make("and", as_truth(self), as_truth(other))

    __rand__ = __and__

    def __or__(self, other: Any) -> Any:
        return make("or", as_truth(self), as_truth(other))

    __ror__ = __or__

    def negate(self) -> Symbol:
        """True where this is not."""
        return make("not", as_truth(self))

    def __invert__(self) -> Symbol:
        # Python's own numbers would flip their bits, so the interpreter could not follow.
        raise RuleError("a rule cannot use '~'; write 'not x', or 'x == 0'")

    def __hash__(self) -> int:
        return id(self) >> 4

    def __float__(self) -> float:
        raise RuleError(
            "a factor's value is not known while the rule is compiled, so float(), int(), math.* and numpy cannot use"
            " it; use arithmetic, or segar.language.sqrt, exp, log, sin, cos, tan, tanh, arctan2, hypot, minimum, maximum,"
            " where"
        )

    __int__ = __index__ = __complex__ = __float__  # type: ignore[assignment]

    def __iter__(self) -> Any:
        raise RuleError("a rule cannot loop over a factor; write a rule on several entities instead")

    def __len__(self) -> int:
        raise RuleError("a scalar factor has no length")

    def __array__(self, *_: Any, **__: Any) -> Any:
        raise RuleError(NO_NUMPY)

    def __repr__(self) -> str:
        if self.op == "const":
            return repr(self.args[0])
        if self.op == "load":
            return f"{self.args[1].__name__}{self.args[0]}"
        return f"{self.op}({', '.join(map(repr, self.args))})"


@contextmanager
def deciding_by(decide: Callable[[Symbol], bool]) -> Iterator[None]:
    """A context in which ``bool()`` of a symbolic condition returns what ``decide`` answers."""
    _deciders.append(decide)
    try:
        yield
    finally:
        _deciders.pop()


def make(op: str, *args: Any) -> Any:
    """The node ``op(args)``; arithmetic on constants alone is done at once."""
    if op not in ("const", "load", "parameter", "draw", "relation", "action", "wall") and all(
        isinstance(a, Symbol) and a.op == "const" for a in args
    ):
        return as_symbol(evaluate(op, [a.args[0] for a in args]))
    key = (op, *[(Symbol, id(a)) if isinstance(a, Symbol) else _constant_key(a) for a in args])
    symbol = _interned.get(key)
    if symbol is None:
        symbol = Symbol()
        symbol.op, symbol.args = op, args
        _interned[key] = symbol
    return symbol


def walk(symbol: Symbol) -> list[Symbol]:
    """The symbol and all that it is computed from, each once."""
    seen: dict[Symbol, None] = {}
    stack = [symbol]
    while stack:
        node = stack.pop()
        if node not in seen:
            seen[node] = None
            stack += [a for a in node.args if isinstance(a, Symbol)]
    return list(seen)


def as_symbol(value: Any) -> Symbol:
    """A symbol for a Python number or truth value; symbols pass through."""
    if isinstance(value, Symbol):
        return value
    if isinstance(value, bool):
        return make("const", value)
    if isinstance(value, (int, float)):
        return make("const", float(value))
    raise RuleError(f"a rule computes with numbers and vectors, not with {type(value).__name__} ({value!r})")


def as_truth(value: Any) -> Symbol:
    """A truth-valued symbol: numbers are true where they are not zero."""
    symbol = as_symbol(value)
    if symbol.op == "const":
        return make("const", bool(symbol.args[0]))
    return symbol if symbol.is_truth else make("ne", symbol, make("const", 0.0))


def evaluate(op: str, values: list[Any]) -> Any:
    """The operation on Python numbers, with the semantics of :class:`segar.language.values.Number`."""
    match op:
        case "and":
            return bool(values[0]) and bool(values[1])
        case "or":
            return bool(values[0]) or bool(values[1])
        case "not":
            return not values[0]
        case "select":
            return values[1] if values[0] else values[2]
    first, *others = map(Number, values)
    result = python_function(op)(first, *others)
    return bool(result) if op in TRUTHS else float(result)


def _constant_key(value: Any) -> Any:
    if isinstance(value, float):
        return ("float", struct.pack("<d", value)) if not math.isnan(value) else ("float", "nan")
    return (type(value), value)
