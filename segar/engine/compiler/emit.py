"""Expressions and loops -> source: temporaries with names in nested scopes, so that each expression is computed once; loops
over groups of slots, and the tests that an entity matches."""

from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager
from typing import Any

from segar.engine.compiler.spec import Group
from segar.language import Rule, Symbol, make, walk
from segar.support import mathematics

BINARY = {"add": "+", "sub": "-", "mul": "*", "div": "/", "lt": "<", "le": "<=", "eq": "==", "ne": "!="}
BINARY |= {"and": "and", "or": "or"}
UNARY = {"neg": "-", "not": "not "}
CALLS = {"sqrt": "math.sqrt", "abs": "abs", "sign": "np.sign"}  # exact everywhere
MATHEMATICS = frozenset(mathematics.__all__)  # the other functions, which the module imports where it calls them


class Writer:
    """Lines of source with indentation, and the temporaries that are visible at the current place.

    Args:
        atom: the source of a leaf symbol (load, parameter, draw, relation, action, wall).
        called: collects the names of :mod:`segar.support.mathematics` that the source calls.
    """

    def __init__(self, atom: Callable[[Symbol], str], called: set[str]) -> None:
        self.lines: list[str] = []
        self.indent = 0
        self.groups: dict[str, Any] = {}  # the group that each loop variable runs over
        self.knows_topmost = False  # whether top_i holds the floor that entity i is on
        self._atom = atom
        self._called = called
        self._scopes: list[dict[Symbol, str]] = [{}]
        self._count = 0

    def line(self, text: str) -> None:
        self.lines.append("    " * self.indent + text)

    def text(self) -> str:
        """All lines."""
        return "\n".join(self.lines)

    @contextmanager
    def block(self, header: str) -> Iterator[None]:
        """An indented block with its own scope; an empty body becomes ``pass``."""
        self.line(header)
        self.indent += 1
        start = len(self.lines)
        with self.scope():
            yield
        if len(self.lines) == start:
            self.line("pass")
        self.indent -= 1

    @contextmanager
    def scope(self) -> Iterator[None]:
        """A scope without indentation."""
        self._scopes.append({})
        yield
        self._scopes.pop()

    def value(self, symbol: Symbol) -> str:
        """The name (or constant) that holds ``symbol`` here, computing it first where it is not known yet."""
        for part in walk(symbol, self._known):
            text = self._text(part)
            if part.op not in ("parameter", "action"):
                self._count += 1
                self.line(f"t{self._count} = {text}")
                text = f"t{self._count}"
            self._scopes[-1][part] = text
        known = self._known(symbol)
        assert known is not None
        return known

    def _known(self, symbol: Symbol) -> str | None:
        """The constant, or the name that holds the symbol here; None where it is not computed yet."""
        if symbol.op == "const":
            return constant(symbol.args[0])
        return next((scope[symbol] for scope in reversed(self._scopes) if symbol in scope), None)

    def _text(self, symbol: Symbol) -> str:
        op, args = symbol.op, symbol.args
        if op in BINARY:
            return f"{self.value(args[0])} {BINARY[op]} {self.value(args[1])}"
        if op in CALLS or op in MATHEMATICS:
            if op in MATHEMATICS:
                self._called.add(op)
            return f"{CALLS.get(op, op)}({', '.join(self.value(a) for a in args)})"
        if op in UNARY:
            return f"{UNARY[op]}{self.value(args[0])}"
        if op == "select":
            condition, yes, no = (self.value(a) for a in args)
            return f"{yes} if {condition} else {no}"
        return self._atom(symbol)


def constant(value: Any) -> str:
    """Source of a constant; infinities and nan by their numpy names."""
    text = repr(value if isinstance(value, bool) else float(value))
    named = {"nan": "np.nan", "inf": "np.inf", "-inf": "-np.inf"}
    return named.get(text, f"({text})" if text.startswith("-") else text)


def bind(symbol: Symbol, variables: tuple[str, ...], rule: int) -> Symbol:
    """The expression with its arguments replaced by loop variables: equal reads of two rules become one symbol."""
    bound: dict[Symbol, Symbol] = {}
    for part in walk(symbol):
        op, args = part.op, part.args
        if op == "load":
            bound[part] = make("load", variables[args[0]], *args[1:])
        elif op == "relation":
            bound[part] = make("relation", args[0], variables[args[1]], variables[args[2]])
        elif op == "draw":
            bound[part] = make("draw", rule, args[0], *variables)
        else:
            bound[part] = make(op, *(bound[a] if isinstance(a, Symbol) else a for a in args))
    return bound[symbol]


VARIABLES = ("i", "j", "k")


@contextmanager
def over_group(w: Writer, group: Group, variable: str) -> Iterator[None]:
    """A loop over the group's slots, or a plain assignment where there is one."""
    with w.scope() if group.is_single else w.block(f"for {variable} in {group.loop}:"):
        if group.is_single:
            w.line(f"{variable} = {group.slots[0]}")
        yield


def condition(w: Writer, test: str) -> AbstractContextManager[None]:
    """An ``if`` block, or nothing but a scope where the test is empty."""
    return w.block(f"if {test}:") if test else w.scope()


def match_test(variable: str, mask: int) -> str:
    """Source of the test that an entity's bits include the mask; empty for no test."""
    return f"(bits[{variable}] & {mask}) == {mask}" if mask else ""


def active_test(w: Writer, rule: Rule) -> str:
    """Source of the test that the rule holds in the level; empty for no test."""
    return "" if rule.active is None else f"{w.value(make('parameter', rule.active))} != 0.0"


def both(*tests: str) -> str:
    """The conjunction of the tests that are not empty."""
    return " and ".join(t for t in tests if t)


def share(a: Group, b: Group) -> bool:
    """Whether some slot is in both groups."""
    return not set(a.slots).isdisjoint(b.slots)
