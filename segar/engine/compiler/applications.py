"""A rule with one of its arguments as the target, and loop variables in place of its arguments."""

from dataclasses import dataclass, replace

from segar.engine.compiler.emit import bind
from segar.engine.compiler.loops import VARIABLES
from segar.language import Branch, Leaf, Pattern, Rule, Symbol, Tree, symbols_of, walk


@dataclass(frozen=True)
class Application:
    """A rule with its number in the kernel, and the argument whose effects are gathered."""

    rule: Rule
    number: int
    target: int

    @property
    def needs(self) -> tuple[Pattern, ...]:
        return self.rule.needs

    @property
    def target_needs(self) -> Pattern:
        return self.rule.needs[self.target]

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
    effects = (replace(e, components=tuple(bind(c, a.variables, a.number) for c in e.components)) for e in tree.effects)
    return Leaf(tuple(effects))


def application_symbols(a: Application) -> list[Symbol]:
    """All symbols of a rule and its relation."""
    return symbols_of(a.rule.tree) + (walk(a.rule.relation.truth) if a.rule.relation is not None else [])
