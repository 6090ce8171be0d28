"""A rule as one of its arguments sees it: loop variables in place of arguments."""

from __future__ import annotations

from dataclasses import dataclass, replace

from segar.engine.compiler.emit import bind
from segar.engine.compiler.loops import VARIABLES
from segar.engine.compiler.spec import Needs, symbols_of
from segar.language import Branch, Leaf, Rule, Symbol, Tree, walk


@dataclass(frozen=True)
class Application:
    """A rule seen from one of its arguments: outcomes on that argument are gathered."""

    rule: Rule
    number: int
    target: int
    needs: tuple[Needs, ...]

    @property
    def variables(self) -> tuple[str, ...]:
        """Loop variable of each argument: the target is ``i``, the others follow."""
        others = iter(VARIABLES[1:])
        return tuple("i" if a == self.target else next(others) for a in range(len(self.needs)))


def bind_tree(tree: Tree, a: Application) -> Tree:
    """The tree with its arguments replaced by the application's loop variables."""
    if isinstance(tree, Branch):
        condition = bind(tree.condition, a.variables, a.number)
        return Branch(condition, bind_tree(tree.yes, a), bind_tree(tree.no, a))
    outcomes = tuple(
        replace(o, components=tuple(bind(c, a.variables, a.number) for c in o.components)) for o in tree.outcomes
    )
    return Leaf(outcomes)


def application_symbols(a: Application) -> list[Symbol]:
    """All symbols of a rule and its relation."""
    return symbols_of(a.rule.tree) + (walk(a.rule.relation.truth) if a.rule.relation is not None else [])
