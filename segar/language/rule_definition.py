"""A rule: a plain typed function, read and traced when it is defined."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property, partial
from typing import Any, overload

from segar.errors import RuleError
from segar.language.entities import Entity, Object, Thing, Tile
from segar.language.factors import Factor
from segar.language.parameters import Parameter
from segar.language.pickling import ByName
from segar.language.relations import Relation, as_relation
from segar.language.signature import Pattern, Signature, code_place, read_signature, symbolic_arguments
from segar.language.tracing import Tree, effects_leaf, effects_of, is_same, number_leaf, symbols_of, trace, truth_leaf

SPECIFICITY_THING = 4  # an argument's entity class makes a rule this specific (2022: rules)
SPECIFICITY_OBJECT = 5
SPECIFICITY_SUBCLASS = 6


@dataclass(frozen=True, eq=False)
class Rule(ByName):
    """A function with its pattern and decision tree. Calling it runs the plain function.

    Attributes:
        relation: the rule applies only where this holds.
        priority: how specific the rule is; among several ``SetFactor`` on one factor the highest wins.
        recheck: the rule is evaluated again, with all its effects, before velocities change (death does that).
        active: the rule holds only in levels in which this world parameter is not 0; None: in all.
    """

    function: Callable[..., Any]
    signature: Signature
    tree: Tree
    relation: Relation | None
    priority: int
    recheck: bool
    active: type[Parameter] | None = None

    @property
    def where(self) -> str:
        return code_place(self.function)

    def where_active(self, parameter: type[Parameter]) -> "Rule":
        """The same rule, which holds only in levels in which ``parameter`` is not 0.

        Raises:
            RuleError: the rule depends on another parameter in this way already.
        """
        if self.active is not None:
            raise RuleError(
                f"{self.where}: holds only where {self.active.__name__} is not 0, and cannot depend on"
                f" {parameter.__name__} too"
            )
        return replace(self, active=parameter)

    @property
    def parameters(self) -> tuple[type[Parameter], ...]:
        """The world parameters that the function takes, and the one that says where the rule holds."""
        return (*self.signature.parameters, *(() if self.active is None else (self.active,)))

    @property
    def changes(self) -> frozenset[type[Factor]]:
        """The factors that the rule declares to change."""
        return frozenset(factor for _, factor in self.signature.effects)

    @cached_property
    def needs(self) -> tuple[Pattern, ...]:
        """What each entity of the rule must have: the factors of its pattern, and those that the function reads or sets.

        What a relation reads is not among them: the relation does not hold for an entity without these.
        """
        factors = [dict.fromkeys(p.factors) for p in self.signature.entities]
        for symbol in symbols_of(self.tree):
            if symbol.op == "load":
                factors[symbol.args[0]].setdefault(symbol.args[1])
        for effect in effects_of(self.tree):
            factors[effect.argument].setdefault(effect.factor)
        types = [p.entity_type for p in self.signature.entities]
        return tuple(Pattern(tuple(f), t) for f, t in zip(factors, types, strict=True))

    def require_current(self) -> None:
        """Raise :class:`RuleError` if the function computes something else now, as what it reads has changed.

        Those of SEGAR read nothing that changes.
        """
        is_ours = str(self.function.__module__).startswith("segar.")
        if not is_ours and not is_same(self.tree, _tree_of(self.function, self.signature)):
            raise RuleError(
                f"{self.where}: computes something else than when the rule was made. A variable that it reads, of its module or"
                " of a loop around it, has changed. Make the rule anew, or in a function that takes the value"
            )

    def __repr__(self) -> str:
        return f"<rule {self.where}>"


@overload
def rule(function: Callable[..., Any], /) -> Rule: ...
@overload
def rule(
    *, relation: Any = None, priority: int | None = None, recheck: bool = False
) -> Callable[[Callable[..., Any]], Rule]: ...
def rule(
    function: Callable[..., Any] | None = None,
    /,
    *,
    relation: Any = None,
    priority: int | None = None,
    recheck: bool = False,
) -> Any:
    """Make a rule of a typed function; use as ``@rule`` or ``@rule(relation=is_on)``.

    Args:
        relation: a typed truth-valued function, or relations combined by ``&`` and ``|``.
        priority: overrides the specificity that follows from relation and entity classes.
        recheck: evaluate once more, with all effects, just before velocities change.

    Raises:
        RuleError: the function cannot be understood or traced; the message names the line.
    """
    if function is None:
        return lambda f: _make_rule(f, relation, priority, recheck)
    return _make_rule(function, relation, priority, recheck)


def as_rule(function: Any) -> Rule:
    """A rule from a rule or an undecorated typed function."""
    return function if isinstance(function, Rule) else _make_rule(function, None, None, False)


def value_rule(function: Callable[..., Any], truth: bool) -> Rule:
    """A typed function that returns a number (or a truth value): a reward, a termination."""
    signature = read_signature(function, returns_effects=False, reduction="every" if truth else "best")
    tree = trace(function, symbolic_arguments(signature), truth_leaf if truth else number_leaf, code_place(function))
    return Rule(function, signature, tree, None, 0, False)


def _make_rule(function: Callable[..., Any], relation: Any, priority: int | None, recheck: bool) -> Rule:
    signature = read_signature(function)
    if not signature.entities:
        raise RuleError(f"{code_place(function)}: a rule needs at least one factor or entity to act on")
    condition = as_relation(relation) if relation is not None else None
    if condition is not None and len(condition.signature.entities) > len(signature.entities):
        raise RuleError(
            f"{code_place(function)}: relation {condition.name} needs {len(condition.signature.entities)} entities,"
            f" the rule has {len(signature.entities)}"
        )
    tree = _tree_of(function, signature)
    if priority is None:
        of_types = (specificity_of(pattern.entity_type) for pattern in signature.entities)
        priority = max([condition.specificity if condition else 0, *of_types])
    return Rule(function, signature, tree, condition, priority, recheck)


def _tree_of(function: Callable[..., Any], signature: Signature) -> Tree:
    finish = partial(effects_leaf, signature.effects)
    return trace(function, symbolic_arguments(signature), finish, code_place(function))


def specificity_of(kind: type[Entity] | None) -> int:
    """How specific a rule or a prior for entities of this type is; for None, of any type."""
    if kind is None or not issubclass(kind, Thing):
        return 0
    if kind is Thing:
        return SPECIFICITY_THING
    return SPECIFICITY_OBJECT if kind in (Object, Tile) else SPECIFICITY_SUBCLASS
