"""Scalar expressions: what a rule computes with while it is traced.

A :class:`Symbol` is a node of an expression graph. Nodes are interned, so equal expressions are one object and the
generated code computes them once. Constants fold; nothing else is simplified (0 * x stays, since x may be nan or inf).
"""

from __future__ import annotations

import traceback
import weakref
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from functools import partial, partialmethod
from hashlib import sha256
from typing import Any, ClassVar

from segar.errors import RuleError
from segar.language.values import Number, ScalarArithmetic, Source, VectorValue, binary, float_function

LONGEST_TEXT = 10_000  # characters of an expression that are shown; a longer part is shown by its hash

Refusal = tuple[RuleError, traceback.StackSummary]

_interned: weakref.WeakValueDictionary[Any, Symbol] = weakref.WeakValueDictionary()
_decide: ContextVar[Callable[[Symbol], bool] | None] = ContextVar("decide", default=None)
"""Decides what a condition is on the path that this thread traces; None where it traces none."""
_refused: ContextVar[list[Refusal]] = ContextVar("refused")
"""What was refused on this path, with the calls that led there."""

TRUTHS = frozenset({"lt", "le", "gt", "ge", "eq", "ne", "and", "or", "not", "relation"})

NO_NUMPY = "a rule cannot call numpy; use arithmetic, or segar.language.sqrt, where, minimum ..."


class Traced:
    """What a rule computes with, in place of a Python value, while it is traced.

    The value is not known then. What a sub-class does not define of the types that it ``stands_for`` is refused, as code
    that asked for it would decide once and for all time.
    """

    __slots__ = ()
    what: ClassVar[str]
    instead: ClassVar[str]

    def __init_subclass__(cls, stands_for: tuple[type, ...]) -> None:
        defined = {"__new__", "__getattribute__", "__doc__", *(name for c in cls.__mro__[:-1] for name in vars(c))}
        for kind in stands_for:
            for name, member in vars(kind).items():
                if name not in defined:
                    refusing = partial(_refuse_use, f"'{name.strip('_')}'")
                    setattr(cls, name, partialmethod(refusing) if callable(member) else property(refusing))

    def refuse(self, use: str, instead: str = "") -> Any:
        """Raise :class:`RuleError`: this use needs the value."""
        raise refusal(
            f"{self.what} is not known while the rule is compiled, so {use} cannot use it; {instead or self.instead}"
        )


def _refuse_use(use: str, traced: Traced, *_: Any, **__: Any) -> Any:
    return traced.refuse(use)


def refusal(message: str) -> RuleError:
    """The error of a rule that uses what it is traced with as it cannot; to be raised, and remembered if it is caught."""
    error = RuleError(message)
    if is_traced():
        _refused.get().append((error, traceback.extract_stack()))
    return error


class Symbol(ScalarArithmetic, Traced, stands_for=(float, bool, int)):
    """A node: an operation and its operands. Made by :func:`make`, never directly."""

    __array_ufunc__ = None
    __slots__ = ("__weakref__", "args", "op")
    op: str
    args: tuple[Any, ...]
    what = "a factor's value"
    instead = (
        "use arithmetic, or segar.language.sqrt, exp, log, sin, cos, tan, tanh, arctan2, hypot, minimum, maximum, where"
    )

    @property
    def __class__(self) -> type:  # what isinstance asks while a rule is traced
        return Symbol if not is_traced() else bool if self.is_truth else Number

    def __reduce__(self) -> tuple[Any, ...]:
        self._require_known("pickles and copies", "use it as it is")
        order = walk(self)
        place = {symbol: n for n, symbol in enumerate(order)}
        return _made_of, ([(s.op, *(place[a] if type(a) is Symbol else (a,) for a in s.args)) for s in order],)

    def _require_known(self, use: str, instead: str) -> None:
        """Refuse a use of the symbol itself by the rule that is traced; the compiler may use it so."""
        if is_traced():
            self.refuse(use, instead=instead)

    def _apply(self, operation: str, *operands: Any) -> Any:
        if any(type(operand) is VectorValue for operand in operands):
            return NotImplemented
        for operand in operands:
            if operand is None or isinstance(operand, str):
                raise refusal(f"a factor cannot be combined or compared with {operand!r}")
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
        condition = as_truth(self)
        decide = _decide.get()
        if decide is None:
            raise refusal("a symbolic condition was tested outside a rule")
        return decide(condition)

    def __pos__(self) -> Symbol:
        return self

    def select(self, yes: Any, no: Any) -> Symbol:
        return make("select", as_truth(self), as_symbol(yes), as_symbol(no))

    __lt__, __gt__ = binary("lt"), binary("lt", swapped=True)
    __le__, __ge__ = binary("le"), binary("le", swapped=True)
    __eq__, __ne__ = binary("eq"), binary("ne")

    def __and__(self, other: Any) -> Any:
        return make("and", *_truths(self, other))

    __rand__ = __and__

    def __or__(self, other: Any) -> Any:
        return make("or", *_truths(self, other))

    __ror__ = __or__

    def negate(self) -> Symbol:
        """True where this is not."""
        return make("not", as_truth(self))

    def __invert__(self) -> Symbol:
        # Python's own numbers would flip their bits, so the interpreter could not follow.
        raise refusal("a rule cannot use '~'; write 'not x', or 'x == 0'")

    def __hash__(self) -> int:
        self._require_known("sets, keys and caches", "compare it, as in 'm == 1.0' or 'm in (1.0, 2.0)'")
        return id(self) >> 4

    def __float__(self) -> float:
        return self.refuse("float(), int(), math.* and numpy")

    __int__ = __complex__ = __float__  # type: ignore[assignment]
    __index__ = property(__float__)  # type: ignore[assignment] # also whoever asks whether there is one is refused

    @property
    def __array__(self) -> Any:
        raise refusal(NO_NUMPY)

    def __repr__(self) -> str:
        self._require_known("str(), repr(), f-strings and print()", "compare it as a number")
        texts: dict[Any, str] = {}
        for part in walk(self):
            if part.op == "load":
                texts[part] = f"{part.args[1].__name__}{part.args[0]}"
            else:
                inner = ", ".join(texts[a] if type(a) is Symbol else repr(a) for a in part.args)
                texts[part] = inner if part.op == "const" else f"{part.op}({inner})"
            if len(texts[part]) > LONGEST_TEXT:
                texts[part] = f"{part.op}({sha256(texts[part].encode()).hexdigest()})"
        return texts[self]


@contextmanager
def deciding_by(decide: Callable[[Symbol], bool]) -> Iterator[list[Refusal]]:
    """A context in which ``bool()`` of a symbolic condition returns what ``decide`` answers; it holds what was refused."""
    refused: list[Refusal] = []
    before = _decide.set(decide), _refused.set(refused)
    try:
        yield refused
    finally:
        _decide.reset(before[0])
        _refused.reset(before[1])


def is_traced() -> bool:
    """Whether this thread traces a rule."""
    return _decide.get() is not None


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


def walk(symbol: Symbol, known: Callable[[Symbol], Any] = lambda _: False) -> list[Symbol]:
    """The symbol and all that it is computed from, each once and after its own operands, in the order in which Python would
    compute them.

    Args:
        known: whether a symbol need not be computed; then it is left out, with what only it is computed from.
    """
    found: dict[Symbol, None] = {}
    stack = [] if known(symbol) else [symbol]
    while stack:
        node = stack[-1]
        missing = (a for a in node.args if type(a) is Symbol and a not in found and not known(a))
        waiting = next(missing, None)
        if waiting is None:
            found[stack.pop()] = None
        else:
            stack.append(waiting)
    return list(found)


def _made_of(parts: list[tuple[Any, ...]]) -> Any:
    """The last of nodes whose operands are the numbers of nodes before them, or constants in tuples of one."""
    made: list[Any] = []
    for op, *operands in parts:
        made.append(make(op, *(a[0] if isinstance(a, tuple) else made[a] for a in operands)))
    return made[-1]


def as_symbol(value: Any) -> Symbol:
    """A symbol for a Python number or truth value; symbols pass through."""
    kind = type(value)
    if kind is Symbol:
        return value
    if issubclass(kind, bool):
        return make("const", value)
    if issubclass(kind, (int, float)):
        return make("const", float(value))
    raise refusal(f"a rule computes with numbers and vectors, not with {kind.__name__} ({value!r})")


def as_truth(value: Any) -> Symbol:
    """A truth-valued symbol: numbers are true where they are not zero."""
    symbol = as_symbol(value)
    if symbol.op == "const":
        return make("const", bool(symbol.args[0]))
    return symbol if symbol.is_truth else make("ne", symbol, make("const", 0.0))


def _truths(*values: Any) -> list[Symbol]:
    """Two truths for ``&`` and ``|``, which Python's numbers, as the interpreter has them, do not have."""
    symbols = [as_symbol(value) for value in values]
    if not all(symbol.is_truth for symbol in symbols):
        raise refusal("'&' and '|' take comparisons, not numbers; write 'and' and 'or', or compare, as in 'alive == 1'")
    return symbols


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
    result = float_function(op)(*map(float, values))
    return bool(result) if op in TRUTHS else float(result)


def _constant_key(value: Any) -> Any:
    return ("float", value.hex()) if isinstance(value, float) else (type(value), value)
