"""What all parts of a kernel's source share: decorators, arguments, rules with loop variables in place of their arguments,
trees, how a symbol reads from the state, and rules that set one factor of one entity: the most specific one wins, equally
specific ones must agree."""

import hashlib
import inspect
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from types import ModuleType

from segar.engine.compiler.checks import MOST_DRAWS
from segar.engine.compiler.emit import VARIABLES, Writer, bind, both, match_test
from segar.engine.compiler.spec import Matcher, relation_mask, static_relation
from segar.language import Branch, Floor, Layout, Leaf, Pattern, Rule, Symbol, Tree, symbols_of, walk

# _nrt=False: the kernel allocates nothing, so array views need no reference counts, whose atomic operations would cost
# as much as the physics of a small world.
ENTRY_DECORATOR = '@njit(error_model="numpy", nogil=True, cache=True, _nrt=False)'
# Only kernels call these: wrappers for calls from Python and from C would take a fifth of the time to compile them.
DECORATOR = '@njit(error_model="numpy", nogil=True, _nrt=False, no_cpython_wrapper=True, no_cfunc_wrapper=True)'
# Numba's own passes grow faster than linearly with a function's length, and its calls are slow with array arguments:
# short functions that LLVM must inline compile fast and run fast.
INLINE_DECORATOR = DECORATOR[:-1] + ", forceinline=True)"
# One environment: V values, W and U and L scratch, P parameters, A action, err the conflict that was found.
STATE = "V, W, U, bits, kind, count, vertex, hull_radius, P, A, L, key, tick, err"


def import_line(module: ModuleType, names: str) -> str:
    """An import line with the module's hash: its machine code is part of the kernel, whose name follows from the text."""
    version = hashlib.sha256(inspect.getsource(module).encode()).hexdigest()[:8]
    return f"from {module.__name__} import {names}  # {version}"


@dataclass
class Source:
    """Opens functions of the generated module; their names of arrays are those of ``STATE``."""

    layout: Layout
    matcher: Matcher = field(init=False)
    called: set[str] = field(init=False, default_factory=set)
    """Names of :mod:`segar.support.mathematics` that the functions so far call."""

    def __post_init__(self) -> None:
        self.matcher = Matcher(self.layout)

    @contextmanager
    def function(self, header: str, inline: bool = False) -> Iterator[Writer]:
        """A writer inside ``def header:``."""
        writer = Writer(lambda s: self._atom(writer, s), self.called)
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
            return f"keyed_uniform(key, tick, {rule * MOST_DRAWS + number}, {', '.join(places)})"
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
        top = "top_i" if a == "i" and w.knows_topmost else f"topmost(V, bits, kind, count, vertex, hull_radius, {a})"
        is_floor = self.matcher.match(w.groups[a], Pattern((Floor,)))
        off_floor = f"not ({match_test(a, is_floor)})" if is_floor else ""
        return both(f"{top} == {b}", off_floor, f"within({shapes})" if what == "contains" else "")


@dataclass(frozen=True)
class Application:
    """A rule with its number in the kernel, and the argument whose effects are gathered."""

    rule: Rule
    number: int
    target: int

    @property
    def target_needs(self) -> Pattern:
        return self.rule.needs[self.target]

    @property
    def variables(self) -> tuple[str, ...]:
        """Loop variable of each argument: the target is ``i``, the others follow."""
        others = iter(VARIABLES[1:])
        return tuple("i" if a == self.target else next(others) for a in range(len(self.rule.needs)))


def bind_tree(tree: Tree, a: Application) -> Tree:
    """The tree with its arguments replaced by the application's loop variables."""
    if isinstance(tree, Branch):
        condition = bind(tree.condition, a.variables, a.number)
        return Branch(condition, bind_tree(tree.yes, a), bind_tree(tree.no, a))
    effects = (replace(e, components=tuple(bind(c, a.variables, a.number) for c in e.components)) for e in tree.effects)
    return Leaf(tuple(effects))


def application_symbols(a: Application) -> list[Symbol]:
    """All symbols of a rule and its relation."""
    return symbols_of(a.rule.tree) + (walk(a.rule.relation.truth) if a.rule.relation is not None else [])


def write_tree(
    w: Writer, tree: Tree, variables: tuple[str, ...], number: int, write_leaf: Callable[[Leaf], None]
) -> None:
    """A decision tree as nested ``if``s; rule ``number`` has these loop variables as its entities."""
    if isinstance(tree, Leaf):
        write_leaf(tree)
        return
    with w.block(f"if {w.value(bind(tree.condition, variables, number))}:"):
        write_tree(w, tree.yes, variables, number, write_leaf)
    with w.block("else:"):
        write_tree(w, tree.no, variables, number, write_leaf)


def write_value(w: Writer, tree: Tree, variables: tuple[str, ...], statement: str, number: int = 0) -> None:
    """A tree of values; ``statement`` is the source that uses one, such as ``total += {}``."""

    def write_leaf(leaf: Leaf) -> None:
        assert leaf.value is not None
        w.line(statement.format(w.value(bind(leaf.value, variables, number))))

    write_tree(w, tree, variables, number, write_leaf)


@dataclass(frozen=True)
class FactorSetting:
    """Writes the local names that hold which rule sets a factor, and to which value.

    Args:
        entity: the variable that holds the entity.
        column: first column of the factor; it has ``width`` columns.
        may_conflict: whether rules of equal priority can set the factor; otherwise no conflict is looked for.
    """

    entity: str
    column: int
    width: int
    may_conflict: bool = True

    @property
    def place(self) -> str:
        """What the local names end with."""
        return f"{self.entity}_{self.column}"

    @property
    def is_set(self) -> str:
        """Source of the test whether some rule sets the factor."""
        return f"set_{self.place} >= 0"

    @property
    def values(self) -> list[str]:
        """Local names that hold the value's components."""
        return [f"sx_{self.place}_{c}" for c in range(self.width)]

    def begin(self, w: Writer) -> None:
        """No rule sets the factor yet."""
        w.line(f"set_{self.place} = -1")
        if self.may_conflict:
            w.line(f"by_{self.place} = rival_{self.place} = -1")
        for name in self.values:
            w.line(f"{name} = 0.0")

    def add(self, w: Writer, number: int, priority: int, values: list[str]) -> None:
        """Rule ``number`` sets the factor to these values."""
        with w.block(f"if set_{self.place} < {priority}:"):
            w.line(f"set_{self.place} = {priority}")
            for name, value in zip(self.values, values, strict=True):
                w.line(f"{name} = {value}")
            if self.may_conflict:
                w.line(f"by_{self.place}, rival_{self.place} = {number}, -1")
        if self.may_conflict:
            differs = " or ".join(f"{name} != {value}" for name, value in zip(self.values, values, strict=True))
            with w.block(f"elif set_{self.place} == {priority} and ({differs}):"):
                w.line(f"rival_{self.place} = {number}")

    def report_conflict(self, w: Writer) -> None:
        """Write to ``err`` which two rules conflict: 1, the entity, the column, and the numbers of the rules."""
        if self.may_conflict:
            with w.block(f"if rival_{self.place} >= 0:"):
                w.line(f"err[0], err[1], err[2] = 1, {self.entity}, {self.column}")
                w.line(f"err[3], err[4] = by_{self.place}, rival_{self.place}")

    def store(self, w: Writer, state: str = "V") -> None:
        """Write the value to the state; the surroundings test :attr:`is_set`."""
        for c, name in enumerate(self.values):
            w.line(f"{state}[{self.entity}, {self.column + c}] = {name}")
