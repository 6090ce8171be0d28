"""A rule with one of its arguments as the target, and loop variables in place of its arguments."""

from dataclasses import dataclass, replace

from segar import language
from segar.engine.compiler.emit import VARIABLES, bind


@dataclass(frozen=True)
class Application:
    """A rule with its number in the kernel, and the argument whose effects are gathered."""

    rule: language.Rule
    number: int
    target: int

    @property
    def target_needs(self) -> language.Pattern:
        return self.rule.needs[self.target]

    @property
    def variables(self) -> tuple[str, ...]:
        """Loop variable of each argument: the target is ``i``, the others follow."""
        others = iter(VARIABLES[1:])
        return tuple("i" if a == self.target else next(others) for a in range(len(self.rule.needs)))


def bind_tree(tree: language.Tree, a: Application) -> language.Tree:
    """The tree with its arguments replaced by the application's loop variables."""
    if isinstance(tree, language.Branch):
        condition = bind(tree.condition, a.variables, a.number)
        return language.Branch(condition, bind_tree(tree.yes, a), bind_tree(tree.no, a))
    effects = (replace(e, components=tuple(bind(c, a.variables, a.number) for c in e.components)) for e in tree.effects)
    return language.Leaf(tuple(effects))


def application_symbols(a: Application) -> list[language.Symbol]:
    """All symbols of a rule and its relation."""
    return language.symbols_of(a.rule.tree) + (
        language.walk(a.rule.relation.truth) if a.rule.relation is not None else []
    )
