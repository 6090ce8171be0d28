"""Priors: which value or distribution a factor starts with, for which entities, and which of several priors counts.

The more specific prior wins (2022 order, with sub-classes of sub-classes told apart):

=====================================  ===========
condition                              specificity
=====================================  ===========
relation: equality on ID               8
relation: equality on Label            7
entity type: below Object or Tile      6, more derived wins
entity type: Object or Tile            5
entity type: Thing                     4
relation: equality on another factor   2
any other relation                     1
no condition                           0
=====================================  ===========

Of equal ones, the one that also has a relation wins, then the one on the more derived factor.
"""

import difflib
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from segar.errors import FactorError, PriorError, did_you_mean
from segar.language import (
    ARENA,
    Count,
    Entity,
    Factor,
    Flag,
    GlobalFriction,
    Marker,
    Parameter,
    Position,
    Relation,
    Shape,
    Symbol,
    Text,
    ThingFactory,
    as_relation,
    evaluate,
    holds,
    specificity_of,
    walk,
)
from segar.levels.conditional import Dependent, require_short
from segar.noise import Choice, Noise


@dataclass(frozen=True)
class Prior:
    """The initial value of a factor: a constant, or a distribution from which each entity draws once per level.

    Args:
        factor: a factor class (sub-classes of it are meant too), or a world parameter such as ``Gravity``.
        value: a constant of the factor's kind, a :class:`segar.noise.Noise`, or a :class:`Dependent` distribution, which other
            factors of the entity scale and shift; for ``Shape`` a shape or a ``Choice`` of shapes (a
            ``RandomConvexHull`` is drawn anew for each entity of each level).
        entity_type: only entities of this type or a sub-class of it.
        relation: only entities for which this typed truth-valued function of one entity holds.

    Raises:
        PriorError: value, entity type or relation do not suit the factor.
    """

    factor: type[Factor]
    value: Any
    entity_type: type[Entity] | None = None
    relation: Any = None

    def __post_init__(self) -> None:
        _check_factor(self.factor)
        _check_entity_type(self)
        object.__setattr__(self, "value", check_value(self.factor, self.value))
        if self.relation is not None:
            object.__setattr__(self, "relation", as_relation(self.relation))
            factors_read(self)  # raises where the relation needs more than one entity's factors
            require_short(self.relation.truth, f"Prior({self.factor.__name__}, ...): {self.relation.name}")
        if issubclass(self.factor, Parameter) and (self.entity_type is not None or self.relation is not None):
            raise PriorError(f"{self}: {self.factor.__name__} belongs to the world, so it takes no condition")

    @property
    def is_random(self) -> bool:
        """Whether the value is a distribution (a random shape counts as a value)."""
        return isinstance(self.value, (Noise, Dependent))

    def __str__(self) -> str:
        entity = "" if self.entity_type is None else f", entity_type={self.entity_type.__name__}"
        relation = f", relation={self.relation.name}" if isinstance(self.relation, Relation) else ""
        return f"Prior({getattr(self.factor, '__name__', self.factor)}, {self.value!r}{entity}{relation})"


def check_value(factor: type[Factor], value: Any) -> Any:
    """The value or distribution as a prior on ``factor`` keeps it; raises :class:`PriorError`."""
    name = factor.__name__
    if isinstance(value, type) and issubclass(value, Noise):
        raise PriorError(
            f"Prior({name}, {value.__name__}): a distribution is needed, not its class; write {value.__name__}()"
        )
    try:
        if isinstance(value, Dependent):
            _check_dependent(factor, value)
            return value
        if not isinstance(value, Noise):
            return _within_bounds(factor, factor.check(value))
        if factor is Shape:
            return _choice_of_shapes(value)
        _check_noise(factor, value)
    except FactorError as error:
        raise PriorError(f"Prior({name}, {value!r}): {error}") from None
    return value


def check_priors(priors: Sequence[Prior], types: Sequence[type[Entity]]) -> None:
    """Raise :class:`PriorError` if two priors have the same condition, or no entity that a prior is for has its factor."""
    conditions: dict[Any, Prior] = {}
    for prior in priors:
        relation = None if prior.relation is None else id(prior.relation.truth)  # equal expressions are one object
        condition = (prior.factor, prior.entity_type, relation)
        if condition in conditions:
            raise PriorError(
                f"two priors have the same condition, so neither can win: {conditions[condition]} and {prior};"
                " remove one, or condition it on a more specific entity_type"
            )
        conditions[condition] = prior
        if not issubclass(prior.factor, Parameter):
            _check_some_entity_has(prior, types)


def ranked(priors: Sequence[Prior], entity: type[Entity], factor: type[Factor]) -> tuple[Prior, ...]:
    """The priors that may set ``factor`` of ``entity``, most specific first, down to the first unconditional one.

    Raises:
        PriorError: two unconditional priors are equally specific and differ.
    """
    matching = sorted((p for p in priors if _may_set(p, entity, factor)), key=specificity, reverse=True)
    for place, prior in enumerate(matching):
        if not factors_read(prior):
            for rival in matching[place + 1 :]:
                if specificity(rival) == specificity(prior) and not factors_read(rival) and rival.value != prior.value:
                    raise PriorError(
                        f"{factor.__name__} of {entity.__name__}: {prior} and {rival} are equally specific and differ;"
                        f" add one with entity_type={entity.__name__}"
                    )
            return tuple(matching[: place + 1])
    return tuple(matching)


def specificity(prior: Prior) -> tuple[int, int, bool, int]:
    """What two priors are compared by; the larger one wins."""
    kind, relation = prior.entity_type, prior.relation
    return (
        max(specificity_of(kind), relation.specificity if relation is not None else 0),
        len(kind.__mro__) if kind is not None else 0,
        relation is not None,
        len(prior.factor.__mro__),
    )


def factors_read(prior: Prior) -> frozenset[type[Factor]]:
    """The numeric factors that the prior's relation reads: none if entity types alone decide (an unconditional prior).

    Raises:
        PriorError: the relation reads anything but factors of one entity.
    """
    if prior.relation is None:
        return frozenset()
    if len(prior.relation.signature.entities) != 1:
        raise PriorError(f"{prior}: the relation must be about one entity")
    symbols = walk(prior.relation.truth)
    for symbol in symbols:
        geometric = symbol.op == "relation" and isinstance(symbol.args[0], str)
        if geometric or symbol.op in ("parameter", "action", "wall"):
            raise PriorError(f"{prior}: the relation of a prior may read only factors of its entity, not {symbol!r}")
    return frozenset(symbol.args[1] for symbol in symbols if symbol.op == "load")


def factors_needed(prior: Prior) -> frozenset[tuple[str | None, type[Factor]]]:
    """The numeric factors that the prior's relation or distribution reads, which must be drawn before it.

    Returns:
        Pairs of the name of an entity, None for the prior's own one, and a factor.
    """
    own = {(None, factor) for factor in factors_read(prior)}
    noise = prior.value
    return frozenset(own | ({(noise.of, factor) for factor in noise.reads} if isinstance(noise, Dependent) else set()))


def relation_holds(prior: Prior, entity: type[Entity], read: Callable[[type[Factor], int], float]) -> bool:
    """Whether the prior's relation holds for an entity; ``read`` gives a component (0 or 1) of a factor of that entity."""
    return bool(_value(prior.relation.truth, entity, read))


def _value(symbol: Symbol, entity: type[Entity], read: Callable[[type[Factor], int], float]) -> Any:
    """A symbol computed from the entity's factors. ``and`` stops early: later parts may need factors that it does not have."""
    match symbol.op:
        case "const":
            return symbol.args[0]
        case "load":
            held = holds(entity, symbol.args[1])
            assert held is not None
            return read(held, *symbol.args[2:] or (0,))
        case "relation":
            return _known_by_type(symbol, entity)
        case "and":
            return all(_value(part, entity, read) for part in symbol.args)
        case "or":
            return any(_value(part, entity, read) for part in symbol.args)
    return evaluate(symbol.op, [_value(part, entity, read) for part in symbol.args])


def _decided_by_type(symbol: Symbol, entity: type[Entity]) -> bool | None:
    """The truth value that a symbol has for every entity of this type, None where it depends on the entity."""
    match symbol.op:
        case "const":
            return bool(symbol.args[0])
        case "relation":
            return _known_by_type(symbol, entity)
        case "not":
            inner = _decided_by_type(symbol.args[0], entity)
            return None if inner is None else not inner
        case "and" | "or":
            parts = [_decided_by_type(part, entity) for part in symbol.args]
            decisive = symbol.op == "or"
            return decisive if decisive in parts else None if None in parts else not decisive
    return None


def _known_by_type(symbol: Symbol, entity: type[Entity]) -> bool:
    kind, *what = symbol.args[0]
    if kind == "text":
        held = holds(entity, what[0])
        return held is not None and entity.declared[held] == what[1]
    factors, needed = what
    return (needed is None or issubclass(entity, needed)) and all(holds(entity, f) is not None for f in factors)


def _check_factor(factor: Any) -> None:
    if not (isinstance(factor, type) and issubclass(factor, Factor)):
        raise PriorError(f"Prior({factor!r}, ...): the first argument must be a factor class such as Mass")
    if issubclass(factor, Text):
        raise PriorError(f"Prior({factor.__name__}, ...): text belongs to the entity type; declare it in a sub-class")
    if issubclass(factor, Marker):
        raise PriorError(f"Prior({factor.__name__}, ...): a marker has no value; declare it in a sub-class")


def _check_entity_type(prior: Prior) -> None:
    kind, name = prior.entity_type, prior.factor.__name__
    if kind is None:
        return
    if isinstance(kind, ThingFactory) or not (isinstance(kind, type) and issubclass(kind, Entity)):
        raise PriorError(f"Prior({name}, ...): entity_type must be an entity class such as Object, not {kind!r}")
    if issubclass(kind, GlobalFriction):
        raise PriorError(f"Prior({name}, ...): the floor's friction is a parameter; write Prior(FloorFriction, ...)")


def _check_noise(factor: type[Factor], noise: Noise) -> None:
    if noise.width != factor.width:
        place = {0: "among things that are not numbers", 1: "on the line", 2: "on the plane"}
        hint = "; Independent(x, y) makes one of two distributions" if factor.width == 2 else ""
        raise FactorError(f"a distribution {place[noise.width]} does not suit a factor {place[factor.width]}{hint}")
    if issubclass(factor, (Flag, Count)):
        values, masses = noise.atoms
        if abs(sum(masses) - 1) > 1e-9:
            raise FactorError(
                f"{factor.__name__} needs a distribution of whole numbers, such as DiscreteRangeNoise or Bernoulli"
            )
        for value in values:
            factor.check(value)
    if factor.bounds is not None:
        low, high = noise.support
        if high < factor.bounds[0] or low > factor.bounds[1]:
            raise FactorError(f"lies outside the bounds {factor.bounds} of {factor.__name__}")


def _check_dependent(factor: type[Factor], noise: Dependent) -> None:
    if factor.width != 1 or issubclass(factor, (Flag, Count, Shape)):
        raise FactorError("a distribution that depends on other factors is for factors that are one real number")
    if issubclass(factor, Parameter):
        raise FactorError(
            f"{factor.__name__} belongs to the world, so its distribution cannot depend on an entity's factors"
        )


def _within_bounds(factor: type[Factor], value: Any) -> Any:
    if factor.bounds is not None and not factor.bounds[0] <= value <= factor.bounds[1]:
        raise FactorError(f"lies outside the bounds {factor.bounds} of {factor.__name__}")
    if issubclass(factor, Position) and np.abs(np.asarray(value, dtype=float)).max() > ARENA:
        raise FactorError(f"lies outside the arena, which reaches from {-ARENA} to {ARENA}")
    if factor.width and not factor.is_possible(np.asarray(value, dtype=float)).all():
        raise FactorError(f"it must be {factor.possible_values()}")
    return value


def _choice_of_shapes(noise: Noise) -> Choice:
    if not isinstance(noise, Choice):
        raise FactorError("the distribution of a Shape must be a Choice of shapes")
    return Choice([Shape.check(key) for key in noise.keys], noise.p)


MISSPELT = 0.8  # likeness from which a factor's name is taken for another one, misspelt


def _check_some_entity_has(prior: Prior, types: Sequence[type[Entity]]) -> None:
    meant = [t for t in types if prior.entity_type is None or issubclass(t, prior.entity_type)]
    if any(holds(t, prior.factor) is not None for t in meant) or (prior.entity_type is not None and not meant):
        return  # priors for entity types that this distribution does not use may be shared with others
    names = sorted({f.__name__ for t in meant for f in t.declared if not issubclass(f, (Text, Marker))})
    owner = "no entity" if prior.entity_type is None else f"no {prior.entity_type.__name__}"
    name = prior.factor.__name__
    is_near = difflib.get_close_matches(name, names, n=1, cutoff=MISSPELT)
    advice = did_you_mean(name, names) if is_near else (
        f" Known: {', '.join(names)}. Leave the prior out, or number an entity of your own class that has a {name}"
    )  # fmt: skip
    raise PriorError(f"{prior}: {owner} in numbers has {name}.{advice}")


def _may_set(prior: Prior, entity: type[Entity], factor: type[Factor]) -> bool:
    if not issubclass(factor, prior.factor) or (prior.entity_type and not issubclass(entity, prior.entity_type)):
        return False
    return prior.relation is None or _decided_by_type(prior.relation.truth, entity) is not False
