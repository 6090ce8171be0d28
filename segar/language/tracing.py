"""Run a rule on symbols and explore every path through its ``if``s: function -> decision tree of expressions.

``bool()`` of a symbolic condition calls the tracer, which answers True first, and then runs the function again for
False. A condition that was decided on a path keeps its answer.

A function is traced twice. What differs between the two, as random numbers of Python and numpy and the time do, would be a
constant in the kernel, so it is refused.
"""

from __future__ import annotations

import itertools
import traceback
from collections.abc import Callable, Collection, Iterator
from dataclasses import dataclass
from typing import Any

from segar.errors import RuleError
from segar.language import random, symbols
from segar.language.effects import Effect
from segar.language.factors import Factor, Flag
from segar.language.generators import generators_of, reached_by, require_traceable, restore, state_of, watched
from segar.language.symbols import NO_NUMPY, Symbol, as_symbol, as_truth, walk
from segar.language.values import VectorValue

MAX_PATHS = 64


@dataclass(frozen=True)
class EffectExpression:
    """An effect on one factor of one argument: its kind, and an expression for each component of the new value."""

    kind: type[Effect]
    argument: int
    factor: type[Factor]
    components: tuple[Symbol, ...]


@dataclass(frozen=True)
class Leaf:
    """The end of a path: effects of a rule, or the value of a function."""

    effects: tuple[EffectExpression, ...] = ()
    value: Symbol | None = None


@dataclass(frozen=True)
class Branch:
    """A condition and what follows when it holds and when it does not."""

    condition: Symbol
    yes: Tree
    no: Tree


Tree = Leaf | Branch


def leaves_of(tree: Tree) -> list[Leaf]:
    """All leaves of a tree."""
    return [tree] if isinstance(tree, Leaf) else leaves_of(tree.yes) + leaves_of(tree.no)


def effects_of(tree: Tree) -> list[EffectExpression]:
    """The effects at all leaves of a tree."""
    return [effect for leaf in leaves_of(tree) for effect in leaf.effects]


def symbols_of(tree: Tree) -> list[Symbol]:
    """All symbols of a tree, those of conditions and of leaves, each once."""
    seen: dict[Symbol, None] = {}
    stack: list[Tree] = [tree]
    while stack:
        node = stack.pop()
        if isinstance(node, Branch):
            roots = [node.condition]
            stack += [node.yes, node.no]
        else:
            roots = [c for effect in node.effects for c in effect.components]
            roots += [node.value] if node.value is not None else []
        for root in roots:
            seen.update(dict.fromkeys(walk(root)))
    return list(seen)


def parts_of(tree: Tree) -> Iterator[Any]:
    """The symbols of a tree, and in which places they stand: alike, as objects, for trees that are equal."""
    if isinstance(tree, Branch):
        yield from (tree.condition, Branch, *parts_of(tree.yes), Leaf, *parts_of(tree.no))
    else:
        yield tree.value
        for effect in tree.effects:
            yield from (effect.kind, effect.argument, effect.factor, *effect.components)


def is_same(tree: Tree, other: Tree) -> bool:
    """Whether two trees are equal."""
    return [*map(id, parts_of(tree))] == [*map(id, parts_of(other))]  # equal expressions are one object


def trace(function: Callable[..., Any], arguments: list[Any], finish: Callable[[Any], Leaf], where: str) -> Tree:
    """The decision tree of ``function(*arguments)``.

    Args:
        function: plain Python; called twice per path.
        arguments: symbolic arguments.
        finish: turns what the function returned into a leaf.
        where: name and place of the function, for messages.

    Raises:
        RuleError: anything that cannot be traced, at the author's line; more than 64 paths; a function that draws from a
            generator of Python or numpy, or that computes something else when it is called again.
    """
    reached = reached_by(function)
    require_traceable(reached, where)
    generators = generators_of(reached)
    before = [state_of(one) for one in generators]
    try:
        tree = _explore_all(function, arguments, finish, where)
        if [state_of(one) for one in generators] != before:
            raise RuleError(
                f"{where}: draws from a generator of random numbers, of Python or numpy. SEGAR calls the function when it"
                " compiles it and never again, so one draw would stay for all time. A rule draws with segar.random.uniform,"
                " normal or bernoulli; a number that is drawn once belongs outside the function"
            )
        is_unchanged = watched(reached_by(function))  # after the first call, which may fill a cache
        if not is_same(tree, _explore_all(function, arguments, finish, where)) or not is_unchanged():
            raise RuleError(
                f"{where}: computes something else when it is called again, or changes what it reads. It may read a clock, go"
                " on with an iterator, count its calls or draw random numbers. SEGAR calls the function when it compiles"
                " it and never again, so what it read would stay for all time. A rule draws with segar.random.uniform, normal"
                " or bernoulli, and keeps what changes in a factor"
            )
    finally:
        for one, state in zip(generators, before, strict=True):
            restore(one, state)
    return tree


def _explore_all(function: Callable[..., Any], arguments: list[Any], finish: Callable[[Any], Leaf], where: str) -> Tree:
    paths = itertools.count(1)

    def explore(prefix: list[tuple[Symbol, bool]]) -> Tree:
        if next(paths) > MAX_PATHS:
            raise RuleError(
                f"{where}: more than {MAX_PATHS} paths through its conditions."
                " Split the rule, or use segar.language.where(condition, a, b), which does not fork"
            )
        decided, leaf = _run(function, arguments, finish, where, prefix)
        tree: Tree = leaf
        for index in range(len(decided) - 1, len(prefix) - 1, -1):
            condition, _ = decided[index]
            other = explore([*decided[:index], (condition, False)])
            tree = Branch(condition, tree, other)
        return tree

    return explore([])


def _run(
    function: Callable[..., Any],
    arguments: list[Any],
    finish: Callable[[Any], Leaf],
    where: str,
    prefix: list[tuple[Symbol, bool]],
) -> tuple[list[tuple[Symbol, bool]], Leaf]:
    """One path: the decisions taken (the given ones first, then True) and the leaf at its end."""
    decided: list[tuple[Symbol, bool]] = []
    answers: dict[int, bool] = {}

    def decide(condition: Symbol) -> bool:
        negated = condition.op == "not"
        base = condition.args[0] if negated else condition
        if id(base) not in answers:
            answer = prefix[len(decided)][1] if len(decided) < len(prefix) else True
            decided.append((base, answer))
            answers[id(base)] = answer
            if len(decided) > MAX_PATHS:
                raise RuleError("a condition keeps asking: a rule cannot loop until a factor reaches a value")
        return answers[id(base)] != negated

    draws = itertools.count()
    try:
        with symbols.deciding_by(decide) as refused, random.drawing_from(lambda: symbols.make("draw", next(draws))):
            returned = function(*arguments)
        if not refused:
            return decided, finish(returned)
    except Exception as error:  # whatever the author's code raises is told with its line
        message = str(error)
        if not isinstance(error, RuleError):
            message = NO_NUMPY if "__array_ufunc__" in message else f"{type(error).__name__}: {message}"
            message = message.replace("'Symbol' object", "a factor's value")
        calls = traceback.extract_tb(error.__traceback__)
        raise RuleError(f"{where}{_author_line(function, calls)}: {message}") from error
    error, calls = refused[0]  # which some code caught
    raise RuleError(f"{where}{_author_line(function, calls)}: {error}")


def _author_line(function: Callable[..., Any], calls: traceback.StackSummary) -> str:
    """``" (line 12: `x = float(v)`)"``: the innermost line of the author's file."""
    code = getattr(function, "__code__", None)
    frames = [call for call in calls if code and call.filename == code.co_filename]
    if not frames:
        return ""
    last = frames[-1]
    return f" (line {last.lineno}: `{last.line}`)" if last.line else f" (line {last.lineno})"


def effects_leaf(declared: Collection[tuple[type[Effect], type]], returned: Any) -> Leaf:
    """The leaf of the effects that a rule returned; each must be declared as (kind, factor)."""
    effects = returned if isinstance(returned, (tuple, list)) else (returned,)
    return Leaf(effects=tuple(_effect_expression(e, declared) for e in effects if e is not None))


def _effect_expression(effect: Any, declared: Collection[tuple[type[Effect], type]]) -> EffectExpression:
    if not isinstance(effect, Effect):
        raise RuleError(
            f"returns {effect!r}; a rule returns Aggregate[...], Differential[...], SetFactor[...], a tuple of these,"
            " or None"
        )
    if (effect.kind, effect.factor) not in declared:
        promised = ", ".join(f"{kind.__name__}[{factor.__name__}]" for kind, factor in declared) or None
        raise RuleError(f"returns {type(effect).__name__}, but its annotation promises {promised}")
    parts = tuple(effect.value) if isinstance(effect.value, VectorValue) else (effect.value,)
    return EffectExpression(effect.kind, effect.target.argument, effect.target.factor, tuple(map(_as_number, parts)))


def number_leaf(returned: Any) -> Leaf:
    """The leaf of a function that returned a number."""
    if isinstance(returned, VectorValue):
        raise RuleError("returns a vector, but a number is needed")
    return Leaf(value=_as_number(returned))


def truth_leaf(returned: Any) -> Leaf:
    """The leaf of a function that returned a truth value."""
    if isinstance(returned, VectorValue):
        raise RuleError("returns a vector, but a truth value is needed")
    if not _is_truth(as_symbol(returned)):
        raise RuleError("returns a number, but a truth value is needed; compare it, as in 'x > 0'")
    return Leaf(value=as_truth(returned))


def _is_truth(symbol: Symbol) -> bool:
    """Whether an expression is true or false: a comparison, a flag, or a choice of these."""
    if symbol.op == "select":
        return all(map(_is_truth, symbol.args[1:]))
    return symbol.is_truth or (symbol.op == "load" and issubclass(symbol.args[1], Flag))


def _as_number(value: Any) -> Symbol:
    """The value as the state stores it: a truth value becomes 1.0 or 0.0."""
    symbol = as_symbol(value)
    if symbol.is_truth:
        return symbols.make("select", symbol, symbols.make("const", 1.0), symbols.make("const", 0.0))
    return symbol
