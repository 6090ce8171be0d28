"""Type hints -> pattern: what a rule applies to and what it may change. Definition-time errors are raised here.

A rule's argument is a factor (all plain factors come from one entity), a tuple of factors (one entity each), an entity
class (one entity each), a world parameter, ``Action`` (in a task's functions) or ``Wall`` (in contact rules). A task's
functions of the state may have the hints ``Every`` or ``Best`` on their last arguments.
"""

import inspect
import operator
import sys
import typing
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from itertools import islice
from traceback import walk_stack
from types import NoneType, UnionType
from typing import Annotated, Any, Self, TypeVar

from segar.errors import RuleError, did_you_mean
from segar.language.effects import Effect
from segar.language.entities import Entity
from segar.language.factors import Factor, Text, concrete_factors
from segar.language.parameters import Parameter
from segar.language.symbols import Symbol, Traced, is_traced, make, refusal
from segar.language.values import Source, VectorValue

T = TypeVar("T")
Every = Annotated[T, "every"]
"""Hint of a task's truth: it holds only if it holds for every entity of this kind, and there is one. Without the hint
it holds if it holds for any."""
Best = Annotated[T, "best"]
"""Hint of a task's number: the greatest one over all entities of this kind counts. Without the hint they add up."""
REDUCTIONS = {
    "every": ("Every", "a task's terminated, success and death can ask for Every"),
    "best": ("Best", "a task's reward can ask for Best"),
}
"""The name of each kind of reduction, and what can ask for it."""


class Action:
    """Hint for the agent's action; ``action[i]`` is its i-th number, clipped to the task's range."""

    def __getitem__(self, index: int) -> Any:
        raise NotImplementedError("an action has values only inside a task's functions")


class Wall:
    """Hint for the wall that an object touches; ``wall.normal`` is 1 in the axes that it blocks, else 0."""


@dataclass(frozen=True)
class Pattern:
    """What an entity must have to match: factors, and an entity type unless that is None."""

    factors: tuple[type[Factor], ...] = ()
    entity_type: type[Entity] | None = None


@dataclass(frozen=True)
class Argument:
    """One argument of the function: its kind ('factor', 'tuple', 'entity', 'parameter', 'action', 'wall')."""

    name: str
    kind: str
    entity: int = -1
    factors: tuple[type[Factor], ...] = ()
    type: Any = None


@dataclass(frozen=True)
class Signature:
    """The pattern of a rule: its arguments, the entities it needs, and the effects it declares (None: a function).

    The values for all entities that match the last ``reduced`` patterns become one by the ``reduction``: "every" for
    whether all of them hold, "best" for the greatest.
    """

    arguments: tuple[Argument, ...]
    entities: tuple[Pattern, ...]
    effects: tuple[tuple[type[Effect], type[Factor]], ...]
    reduction: str = ""
    reduced: int = 0

    @property
    def parameters(self) -> tuple[type[Parameter], ...]:
        return tuple(a.type for a in self.arguments if a.kind == "parameter")

    def uses(self, kind: str) -> bool:
        return any(a.kind == kind for a in self.arguments)


class EntityView:
    """An entity as a rule sees it: ``entity[Mass]`` reads a factor, by the function ``read``."""

    def __init__(
        self, index: int, type_: type[Entity] | None, read: Callable[[int, type[Factor]], Any], relation: Any
    ) -> None:
        self.index, self.type, self._read, self._relation = index, type_, read, relation

    @property
    def __class__(self) -> type:  # what isinstance asks
        if is_traced():
            raise refusal(
                "which entity it is, is not known while the rule is compiled, so isinstance() cannot use it; let the hint of"
                " the argument be the entity class, or compare its Label or ID, as in entity[Label] == 'ball'"
            )
        return EntityView

    def __getitem__(self, factor: type[Factor]) -> Any:
        if not (isinstance(factor, type) and issubclass(factor, Factor)):
            raise RuleError(f"entity[{factor!r}]: the index must be a factor class")
        declared = self.type.declared if self.type is not None else {}
        if declared and not any(issubclass(f, factor) for f in declared):
            names = [f.__name__ for f in declared]
            owner = getattr(self.type, "__name__", "the entity")
            raise RuleError(f"{owner} has no {factor.__name__}.{did_you_mean(factor.__name__, names)}")
        return self._read(self.index, factor)

    def relation(self, name: str, other: Self) -> Any:
        """The truth of a geometric relation of this entity to another one."""
        return self._relation(name, self.index, other.index)


class WallView:
    """The wall as a contact rule sees it."""

    def __init__(self, normal: VectorValue) -> None:
        self.normal = normal


def code_place(function: Callable[..., Any]) -> str:
    """``name (file.py:12)``, for messages."""
    code = getattr(function, "__code__", None)
    name = getattr(function, "__qualname__", repr(function))
    return f"{name} ({code.co_filename.rsplit('/', 1)[-1]}:{code.co_firstlineno})" if code else name


def read_signature(function: Callable[..., Any], returns_effects: bool = True, reduction: str = "") -> Signature:
    """The signature of a typed function, which may have one kind of ``reduction``, "every" or "best"; none where it is empty.

    Raises:
        RuleError: a hint is missing, unknown, or mixes what cannot be mixed; an effect is declared on a factor that no
            argument holds.
    """
    if not inspect.isfunction(function):
        raise RuleError(f"{function!r} is not a plain Python function")
    hints = hints_of(function)
    arguments: list[Argument] = []
    entities: list[Pattern] = []
    plain: list[tuple[int, type[Factor]]] = []
    reduced = 0
    for name, parameter in inspect.signature(function).parameters.items():
        if parameter.kind in (parameter.VAR_POSITIONAL, parameter.VAR_KEYWORD):
            raise RuleError(f"{code_place(function)}: '*{name}' cannot be matched; name every argument")
        if name not in hints:
            raise RuleError(
                f"{code_place(function)}: argument '{name}' has no type hint; hint a factor, e.g. {name}: Mass"
            )
        hint, reduced_by = _without_reduction(hints[name])
        before = len(entities)
        if isinstance(hint, type) and issubclass(hint, Factor) and not issubclass(hint, Parameter):
            plain.append((len(arguments), hint))
            arguments.append(Argument(name, "factor", 0, (hint,)))
        else:
            arguments.append(_argument(function, name, hint, entities))
        if reduced_by or (reduced and len(entities) > before):
            _check_reduction(function, name, reduced_by, reduction, len(entities) > before)
            reduced += 1
    if plain:
        if entities:
            raise RuleError(
                f"{code_place(function)}: mixes plain factors ({plain[0][1].__name__}) with tuples or entity classes;"
                " put the factors of each entity in its own Tuple[...]"
            )
        entities.append(Pattern(factors=tuple(f for _, f in plain)))
    signature = Signature(tuple(arguments), tuple(entities), (), reduction if reduced else "", reduced)
    if not returns_effects:
        return signature
    if "return" not in hints:
        raise RuleError(
            f"{code_place(function)}: the return has no type hint; say what it changes, e.g. -> Aggregate[Acceleration]"
        )
    effects = tuple(_effects(function, hints["return"]))
    _check_held(function, signature, effects)
    return Signature(signature.arguments, signature.entities, effects)


def symbolic_arguments(signature: Signature) -> list[Any]:
    """One symbolic value per argument, to trace the function with."""
    return [build_argument(a, _load, partial(make, "relation")) for a in signature.arguments]


def build_argument(argument: Argument, read: Callable[..., Any], relation: Callable[..., Any]) -> Any:
    """The value of one argument, given functions that read factors and evaluate relations (as symbols or as numbers)."""
    if argument.kind == "factor":
        return read(argument.entity, argument.factors[0])
    if argument.kind == "tuple":
        return tuple(read(argument.entity, f) for f in argument.factors)
    if argument.kind == "entity":
        return EntityView(argument.entity, argument.type, read, relation)
    return read(-1, argument.type)


def _load(entity: int, factor: Any) -> Any:
    if factor is Action:
        return _ActionSymbols()
    if factor is Wall:
        return WallView(VectorValue(make("wall", 0), make("wall", 1)))
    if issubclass(factor, Parameter):
        return make("parameter", factor)
    if factor.width == 2:
        return VectorValue(make("load", entity, factor, 0), make("load", entity, factor, 1), Source(entity, factor))
    if factor.width == 1:
        return make("load", entity, factor, 0)
    if issubclass(factor, Text):
        return _TextSymbol(Source(entity, factor))
    return None  # markers and shapes only decide what matches


class _TextSymbol(Traced, stands_for=(str,)):
    """A text factor while a rule is traced: it can only be compared, and the entity's type decides."""

    what, instead = "a text factor", "compare it with a text, as in label == 'ball' or label in ('ball', 'cueball')"

    def __init__(self, source: Source) -> None:
        self.source = source

    @property
    def __class__(self) -> type:  # what isinstance asks
        return str

    def __eq__(self, other: object) -> Any:
        if type(other) is not str:
            self.refuse(f"a comparison with {type(other).__name__}")
        at = self.source.argument
        return make("relation", ("text", self.source.factor, other), at, at)

    def __ne__(self, other: object) -> Any:
        return (self == other).negate()

    def __hash__(self) -> int:
        return self.refuse("sets, keys and caches")


class _ActionSymbols(Traced, stands_for=(tuple,)):
    """The action while a rule is traced: how many numbers it has is known when the task is compiled."""

    what, instead = "an action as a whole", "take the numbers of an action by their index, e.g. action[0]"

    def __getitem__(self, index: int) -> Symbol:
        return make("action", operator.index(index))


def _argument(function: Callable[..., Any], name: str, hint: Any, entities: list[Pattern]) -> Argument:
    if isinstance(hint, type) and issubclass(hint, Parameter):
        return Argument(name, "parameter", type=hint)
    if hint is Action or hint is Wall:
        return Argument(name, hint.__name__.lower(), type=hint)
    if isinstance(hint, type) and issubclass(hint, Entity):
        entities.append(Pattern(entity_type=hint))
        return Argument(name, "entity", len(entities) - 1, type=hint)
    if typing.get_origin(hint) is tuple:
        factors = typing.get_args(hint)
        for factor in factors:
            if not (isinstance(factor, type) and issubclass(factor, Factor)) or issubclass(factor, Parameter):
                raise RuleError(f"{code_place(function)}: argument '{name}': {_show(factor)} is not a factor")
        entities.append(Pattern(factors=factors))
        return Argument(name, "tuple", len(entities) - 1, factors)
    raise RuleError(
        f"{code_place(function)}: argument '{name}' has the hint {_show(hint)}, which is not a factor, a Tuple of factors,"
        " an entity class or a world parameter"
    )


def _without_reduction(hint: Any) -> tuple[Any, str]:
    """The hint inside ``Every[...]`` or ``Best[...]``, and the kind of reduction ("" for none)."""
    if typing.get_origin(hint) is Annotated and hint.__metadata__[0] in REDUCTIONS:
        return hint.__origin__, hint.__metadata__[0]
    return hint, ""


def _check_reduction(function: Callable[..., Any], name: str, found: str, allowed: str, is_entity: bool) -> None:
    """Raise :class:`RuleError` where a hint ``Every`` or ``Best`` means nothing, or where one is missing."""
    place = f"{code_place(function)}: argument '{name}'"
    if not found:
        raise RuleError(f"{place}: arguments with {REDUCTIONS[allowed][0]}[...] come last")
    hint, owner = REDUCTIONS[found]
    if found != allowed:
        raise RuleError(f"{place}: only {owner}")
    if not is_entity:
        raise RuleError(f"{place}: {hint}[...] takes an entity class or a Tuple of factors")


def _effects(function: Callable[..., Any], hint: Any) -> typing.Iterator[tuple[type[Effect], type[Factor]]]:
    if hint is None or hint is NoneType:
        return
    if isinstance(hint, type) and issubclass(hint, Effect) and hasattr(hint, "factor"):
        if not (isinstance(hint.factor, type) and issubclass(hint.factor, Factor)):
            raise RuleError(
                f"{code_place(function)}: returns {hint.__name__}, but {_show(hint.factor)} is not a factor"
            )
        yield hint.kind, hint.factor
        return
    if typing.get_origin(hint) in (tuple, typing.Union, UnionType):
        for part in typing.get_args(hint):
            yield from _effects(function, part)
        return
    raise RuleError(
        f"{code_place(function)}: returns {_show(hint)}; a rule returns Aggregate[...], Differential[...], SetFactor[...],"
        " a Tuple of these, or None"
    )


def _check_held(function: Callable[..., Any], signature: Signature, effects: Any) -> None:
    held: set[type[Factor]] = set()
    for argument in signature.arguments:
        held |= set(argument.factors)
        if argument.kind == "entity":
            held |= set(argument.type.declared) if argument.type.declared else {Factor}
    for kind, factor in effects:
        if not any(issubclass(h, factor) or issubclass(factor, h) for h in held):
            names = [h.__name__ for h in held]
            raise RuleError(
                f"{code_place(function)}: returns {kind.__name__}[{factor.__name__}], but no argument holds"
                f" {factor.__name__}; take it as an argument.{did_you_mean(factor.__name__, names)}"
            )


def hints_of(function: Callable[..., Any]) -> dict[str, Any]:
    """Annotations with strings evaluated in the function's module, its closure and the frames that define it."""
    raw = inspect.get_annotations(function)
    if not any(isinstance(hint, str) for hint in raw.values()):
        return raw
    scope = dict(function.__globals__)
    for outer, _ in reversed([*islice(walk_stack(sys._getframe(1)), 12)]):
        if outer.f_globals is function.__globals__:
            scope.update(outer.f_locals)
    scope.update(inspect.getclosurevars(function).nonlocals)
    hints = {}
    for name, hint in raw.items():
        try:
            hints[name] = eval(hint, scope) if isinstance(hint, str) else hint
        except NameError as error:
            known = [f.__name__ for f in concrete_factors()]
            label = "the return" if name == "return" else f"argument '{name}'"
            raise RuleError(
                f"{code_place(function)}: {label}: '{error.name}' is not a factor.{did_you_mean(str(error.name), known)}"
            ) from None
        except Exception as error:  # whatever the author wrote there
            raise RuleError(f"{code_place(function)}: cannot read the hint '{hint}' of '{name}': {error}") from None
    return hints


def _show(hint: Any) -> str:
    return getattr(hint, "__name__", None) or repr(hint)
