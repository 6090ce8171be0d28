"""Distributions that typed functions of other factors scale and shift, factors of the same entity or of another one."""

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from segar.errors import PriorError, naming
from segar.language import (
    Factor,
    Leaf,
    Symbol,
    Tree,
    code_place,
    make,
    number_leaf,
    read_signature,
    symbolic_arguments,
    trace,
    walk,
)
from segar.noise import Noise

Read = Callable[[type[Factor], int], np.ndarray]
"""From a factor and a component (0 or 1) to its values, float64 ``(entities,)``."""

MOST_OPERATIONS = 400  # of an expression that a distribution writes, which its hash and its files hold in full
UNREADABLE = ("parameter", "action", "wall", "relation", "draw")


@dataclass(frozen=True, repr=False, eq=False)
class Dependent:
    """The distribution of ``shift + scale * x`` where x follows ``law``, and shift or scale depend on the entity.

    ``Prior(Mass, Dependent(UniformNoise(0.9, 1.1), scale=weight))`` with ``def weight(size: Size) -> float: ...`` makes
    larger things heavier. ``Prior(Charge, Dependent(GaussianNoise(0, 0.1), shift=opposite, of="golfball"))`` with
    ``def opposite(q: Charge) -> float: ...`` lets charges follow that of one thing. For another distribution in another case,
    condition priors on relations instead.

    Args:
        law: a distribution on the line.
        shift, scale: a number, or a typed function of numeric factors of one entity, written as rules are. What it
            reads is drawn first. The scale must never be zero, which is checked where it is drawn.
        of: name of the entity whose factors are read, one that is in every level; None for the entity itself.

    Raises:
        PriorError: the distribution is not on the line, or a function reads anything but factors of one entity.
    """

    law: Noise
    shift: Any = 0.0
    scale: Any = 1.0
    of: str | None = None

    def __post_init__(self) -> None:
        if not isinstance(self.law, Noise) or self.law.width != 1:
            raise PriorError(f"Dependent needs a distribution on the line, not {self.law!r}")
        if self.of is not None and not isinstance(self.of, str):
            raise PriorError(f"Dependent: of must be the name of an entity, such as 'golfball', not {self.of!r}")
        for name in ("shift", "scale"):
            object.__setattr__(self, name, _expression(name, getattr(self, name)))

    @property
    def reads(self) -> frozenset[type[Factor]]:
        """The factors that shift and scale depend on."""
        symbols = [*walk(self.shift), *walk(self.scale)]
        return frozenset(symbol.args[1] for symbol in symbols if symbol.op == "load")

    def shift_and_scale(self, read: Read, count: int) -> tuple[np.ndarray, np.ndarray]:
        """Shift and scale for ``count`` entities, float64 ``(count,)`` each."""
        found: dict[Symbol, Any] = {}
        with np.errstate(all="ignore"):  # the caller reports values that are not finite
            for symbol in (*walk(self.shift), *walk(self.scale)):
                if symbol not in found:
                    found[symbol] = _operation(symbol, read, found)
        return np.broadcast_to(found[self.shift], (count,)), np.broadcast_to(found[self.scale], (count,))

    def log_prob(self, x: np.ndarray, shift: np.ndarray, scale: np.ndarray) -> np.ndarray:
        """Log mass of the atom at ``x``, else log density."""
        y = (x - shift) / scale
        for value in self.law.atoms[0]:
            y = np.where(x == shift + scale * value, value, y)
        return self.law.log_prob(y) - np.where(self.law.pmf(y) > 0, 0.0, np.log(np.abs(scale)))

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, Dependent):
            return NotImplemented
        same = self.shift is other.shift and self.scale is other.scale  # expressions are one object if equal
        return same and self.law == other.law and self.of == other.of

    def __hash__(self) -> int:
        return hash((self.law, id(self.shift), id(self.scale), self.of))

    def __repr__(self) -> str:
        parts = [f"{name}={_shown(symbol)}" for name, symbol in (("shift", self.shift), ("scale", self.scale))]
        parts += [] if self.of is None else [f"of={self.of!r}"]
        return f"Dependent({self.law!r}, {', '.join(parts)})"


def _expression(name: str, given: Any) -> Symbol:
    if isinstance(given, Symbol):
        return given
    if isinstance(given, (int, float)) and not isinstance(given, bool) and math.isfinite(given):
        return make("const", float(given))
    if not callable(given):
        raise PriorError(f"Dependent: {name} must be a finite number or a typed function of factors, not {given!r}")
    with naming(f"Dependent: {name}", PriorError):
        signature = read_signature(given, returns_effects=False)
        symbol = _number_of(trace(given, symbolic_arguments(signature), number_leaf, code_place(given)))
    strange = next((s.op for s in walk(symbol) if s.op in UNREADABLE), None)
    if len(signature.entities) != 1 or strange:
        reason = f"it uses a {strange}" if strange else f"it takes {len(signature.entities)} entities"
        raise PriorError(f"Dependent: {name}: {code_place(given)} may read only numbers of one entity, and {reason}")
    require_short(symbol, f"Dependent: {name}: {code_place(given)}")
    return symbol


def require_short(symbol: Symbol, where: str) -> None:
    """Raise :class:`PriorError` where an expression is longer than a distribution can write."""
    lengths: dict[int, int] = {}
    for part in walk(symbol):
        lengths[id(part)] = 1 + sum(lengths[id(a)] for a in part.args if isinstance(a, Symbol))
    if lengths[id(symbol)] > MOST_OPERATIONS:
        raise PriorError(
            f"{where} has {lengths[id(symbol)]:.4g} operations where its loops are written out, and a distribution takes at"
            f" most {MOST_OPERATIONS}"
        )


def _number_of(tree: Tree) -> Symbol:
    if isinstance(tree, Leaf):
        assert tree.value is not None
        return tree.value
    return make("select", tree.condition, _number_of(tree.yes), _number_of(tree.no))


def _operation(symbol: Symbol, read: Read, found: dict[Symbol, Any]) -> Any:
    """A symbol for many entities at once, of whose operands the values are found."""
    if symbol.op == "const":
        return symbol.args[0]
    if symbol.op == "load":
        factor: Any = symbol.args[1]
        return read(factor, *symbol.args[2:] or (0,))
    operation = getattr(np, _NUMPY_NAMES.get(symbol.op, symbol.op))
    # As numbers, because truths of numpy add up to a truth.
    return operation(*(np.float64(found[part]) for part in symbol.args))


# What numpy calls the operations of expressions, where it calls them otherwise.
_NUMPY_NAMES = {"sub": "subtract", "mul": "multiply", "div": "true_divide", "pow": "float_power", "neg": "negative"}
_NUMPY_NAMES |= {"lt": "less", "le": "less_equal", "eq": "equal", "ne": "not_equal", "select": "where"}
_NUMPY_NAMES |= {"and": "logical_and", "or": "logical_or", "not": "logical_not"}
_SIGNS = {"add": "+", "sub": "-", "mul": "*", "div": "/", "lt": "<", "le": "<=", "eq": "==", "ne": "!="}


def _shown(symbol: Symbol) -> str:
    """The expression as a reader would write it."""
    if symbol.op == "const":
        return f"{symbol.args[0]:g}"
    if symbol.op == "load":
        factor, *part = symbol.args[1:]
        return factor.__name__ + (f"[{part[0]}]" if factor.width == 2 else "")
    parts = [_shown(part) for part in symbol.args]
    if symbol.op in _SIGNS:
        return f"({parts[0]} {_SIGNS[symbol.op]} {parts[1]})"
    return f"{symbol.op}({', '.join(parts)})"
