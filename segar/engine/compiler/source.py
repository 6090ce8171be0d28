"""What all parts of a kernel's source share: decorators, arguments, and how a symbol reads from the state."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field

from segar.engine.compiler.emit import Writer, bind
from segar.engine.compiler.loops import both, match_test
from segar.engine.compiler.spec import Matcher, Needs, relation_mask, static_relation
from segar.language import Branch, Floor, Layout, Symbol, Tree

# _nrt=False: the kernel allocates nothing, so array views need no reference counts, whose atomic operations would cost
# as much as the physics of a small world.
ENTRY_DECORATOR = '@njit(error_model="numpy", nogil=True, cache=True, _nrt=False)'
DECORATOR = '@njit(error_model="numpy", nogil=True, _nrt=False)'
# Numba's own passes grow faster than linearly with a function's length, and its calls are slow with array arguments:
# short functions that LLVM must inline compile fast and run fast.
INLINE_DECORATOR = '@njit(error_model="numpy", nogil=True, _nrt=False, forceinline=True)'
STATE = "V, W, U, bits, kind, count, vertex, hull_radius, P, A, L, key, tick, err"


@dataclass
class Source:
    """Opens functions of the generated module; their names of arrays are those of ``STATE``."""

    layout: Layout
    matcher: Matcher = field(init=False)

    def __post_init__(self) -> None:
        self.matcher = Matcher(self.layout)

    @contextmanager
    def function(self, header: str, inline: bool = False) -> Iterator[Writer]:
        """A writer inside ``def header:``."""
        writer = Writer(lambda s: self._atom(writer, s))
        writer.line(INLINE_DECORATOR if inline else DECORATOR)
        with writer.block(f"def {header}:"):
            yield writer

    def write_parameters(self, w: Writer) -> None:
        """World parameters by the names that symbols of parameters have."""
        for index in range(len(self.layout.parameters)):
            w.line(f"p{index} = P[{index}]")

    def _atom(self, w: Writer, symbol: Symbol) -> str:
        op, args = symbol.op, symbol.args
        if op == "load":
            variable, factor, component = args
            return f"V[{variable}, {self.matcher.column(w.groups[variable], factor) + component}]"
        if op == "parameter":
            return f"p{self.layout.parameters.index(args[0])}"
        if op == "action":
            return f"A[{args[0]}]"
        if op == "wall":
            return f"n{args[0]}"
        if op == "draw":
            rule, number, *variables = args
            places = (*variables, "0", "0", "0")[:3]
            return f"uniform(key, tick, {rule * 256 + number}, {', '.join(places)})"
        if op == "relation":
            return self._relation(w, symbol)
        raise AssertionError(f"no source for {op}")

    def _relation(self, w: Writer, symbol: Symbol) -> str:
        what, a, b = symbol.args
        if not isinstance(what, str):
            mask = relation_mask(self.matcher, what, w.groups[a])
            return "False" if mask is None else match_test(a, mask) or "True"
        static = static_relation(self.matcher, symbol, w.groups)
        if static is not None:
            return repr(static)
        shapes = f"V, kind, count, vertex, hull_radius, {a}, {b}"
        if what == "overlaps":
            return f"over({shapes})"
        top = "top_i" if a == "i" else f"topmost(V, bits, kind, count, vertex, hull_radius, {a})"
        is_floor = self.matcher.match(w.groups[a], Needs((Floor,), None))
        off_floor = f"not ({match_test(a, is_floor)})" if is_floor else ""
        return both(f"{top} == {b}", off_floor, f"within({shapes})" if what == "contains" else "")


def write_value(w: Writer, tree: Tree, variables: tuple[str, ...], add: str, number: int = 0) -> None:
    """A tree of values: ``add`` is the source that takes one, e.g. ``total += {}``."""
    if isinstance(tree, Branch):
        with w.block(f"if {w.value(bind(tree.condition, variables, number))}:"):
            write_value(w, tree.yes, variables, add, number)
        with w.block("else:"):
            write_value(w, tree.no, variables, add, number)
        return
    assert tree.value is not None
    w.line(add.format(w.value(bind(tree.value, variables, number))))
