"""Interventions on levels: a factor of each level is set as another distribution would have it, and all else stays.

A distribution has a *mechanism* for how many entities there are and of which types, one for each factor, one for each world
parameter, and one for the rules. A mechanism has the name of its factor or parameter; those of entities and rules are
``"Entities"`` and ``"World"``.
"""

import dataclasses
from collections.abc import Collection

import numpy as np

from segar.errors import LevelError
from segar.language import Order, Parameter, Position, Shape, Size, Velocity
from segar.levels.apart import WITHOUT_EFFECT
from segar.levels.distribution import LevelDistribution
from segar.levels.hashing import content_hash
from segar.levels.level_data import OUTLINE, LevelData
from segar.levels.level_set import Levels
from segar.levels.mixing import RULES, differing, mixed_levels, with_room
from segar.levels.priors import Prior
from segar.levels.sampling.placement import fix_levels, too_close
from segar.rules import World

ENTITIES = "Entities"
STAYING = (Position, Velocity, Order)  # of an entity in whose place another one comes


def mechanisms(distribution: LevelDistribution) -> dict[str, str]:
    """Name of each mechanism to a hash of what it is; two distributions differ in those whose hashes differ.

    Factors that follow from others, and the order of drawing, have none.
    """
    world, types = distribution.world or World(), distribution.layout.types
    rules = [(rule.where, repr(rule.tree)) for rule in (*world.rules, *world.on_contact)]
    space = None if world.space is None else world.space.content
    found = {
        ENTITIES: content_hash(distribution.numbers),
        RULES: content_hash([[*map(list, rules)], world.walls, space]),
    }
    priors = [p for p in distribution.priors if not p.entity_type or any(issubclass(t, p.entity_type) for t in types)]
    for factor in (*distribution.layout.factors, Shape):
        if factor not in WITHOUT_EFFECT:
            content: list[object] = [p for p in priors if p.factor.__name__ == factor.__name__]
            if issubclass(factor, Position):
                content += [distribution.positions, distribution.min_distance]
            found[factor.__name__] = content_hash(content)
    plan = distribution.plan
    drawn = {column: prior.value for column, prior in plan.parameter_priors}
    for column, parameter in enumerate(plan.layout.parameters):
        if column not in plan.rule_columns:
            found[parameter.__name__] = content_hash(drawn.get(column, float(plan.parameters[column])))
    return found


def drawn_mechanisms(distribution: LevelDistribution) -> set[str]:
    """The names of mechanisms in which levels of the distribution can differ from each other."""
    plan = distribution.plan
    found = {draw.factor.__name__ for draw in plan.draws if draw.factor not in WITHOUT_EFFECT}
    found |= {plan.layout.parameters[column].__name__ for column, _ in plan.parameter_priors}
    if any(outline.is_random for outline in plan.outlines):
        found.add(Shape.__name__)
    if any(len(group.types) > 1 or not isinstance(group.count, int) for group in plan.groups):
        found.add(ENTITIES)
    return found if plan.rule_space is None else found | {RULES}


def with_mechanisms(
    distribution: LevelDistribution, other: LevelDistribution, names: Collection[str]
) -> LevelDistribution:
    """``distribution``, with the mechanisms of these names as ``other`` has them."""

    def kept(one: LevelDistribution, inside: bool) -> list[Prior]:
        priors = [p for p in one.priors if not issubclass(p.factor, Parameter)]
        return [p for p in priors if (p.factor.__name__ in names) is inside]

    place = other if Position.__name__ in names else distribution
    return dataclasses.replace(
        distribution,
        numbers=(other if ENTITIES in names else distribution).numbers,
        priors=[*kept(distribution, False), *kept(other, True)],
        parameters=_parameters(distribution, names, False) | _parameters(other, names, True),
        positions=place.positions,
        min_distance=place.min_distance,
        world=(other if RULES in names else distribution).world,
        name=f"{distribution}, {' and '.join(sorted(names))} as in {other}",
    )


def set_as(levels: Levels, donors: Levels, names: Collection[str], min_distance: float) -> tuple[Levels, np.ndarray]:
    """Level i with what these mechanisms gave level i of ``donors``, and whether that is a level that differs in nothing else.

    Entities that come have all that the donor's have. One that comes in the place of another stands where that one stood.

    Args:
        donors: as many, in the same slots; unless entities are set, with entities of the same types.
        min_distance: what the distribution asks for [m]; levels with things that are too close, that overlap and would move,
            or that are as before are no twins.

    Returns:
        The levels, and bool ``(n,)``.

    Raises:
        LevelError: the two sets do not fit each other.
    """
    if levels.layout != donors.layout:
        raise LevelError("the levels and those that give factors have different slots, types or parameters")
    layout, factors = levels.layout, [name for name in names if name not in (ENTITIES, Shape.__name__)]
    place, values = layout.columns_of(Position), donors.values.copy()
    values[:, :, place] = donors.sampled_values[:, :, place]  # before the donors' own things were moved apart
    given = with_room(dataclasses.replace(donors, values=values), levels)
    levels = with_room(levels, donors)
    mixed = mixed_levels(levels, given, {"set": factors}, {"set": True}).writable()
    if ENTITIES in names:
        _set_entities(mixed, given)
    if Shape.__name__ in names:
        _set_outlines(mixed, given)
    positions = mixed.values[:, :, place]
    fits = ~too_close(positions, min_distance)
    before = positions.copy()
    fits[fix_levels(mixed)] = False
    if Position.__name__ not in names:  # what is here and there does not move
        stayed = (levels.types >= 0) & (mixed.types >= 0)
        fits &= ((np.nan_to_num(before) == np.nan_to_num(positions)).all(axis=2) | ~stayed).all(axis=1)
    return dataclasses.replace(Levels(**vars(mixed)), sampled_values=mixed.values.copy()), fits & _differ(levels, mixed)


def _parameters(distribution: LevelDistribution, names: Collection[str], inside: bool) -> dict[type[Parameter], object]:
    """World parameters that are given, those inside or those outside ``names``."""
    given = dict(distribution.parameters)
    given |= {p.factor: p.value for p in distribution.priors if issubclass(p.factor, Parameter)}
    return {parameter: value for parameter, value in given.items() if (parameter.__name__ in names) is inside}


def _set_entities(mixed: LevelData, donors: Levels) -> None:
    """Let the entities of donors come where there is none of their type, and others go, in place."""
    columns = mixed.layout.columns
    staying = [columns[f] + k for f in STAYING if f in columns for k in range(f.width)]
    other = mixed.types != donors.types
    replaced = other & (mixed.types >= 0) & (donors.types >= 0)
    values = np.where(other[..., None], donors.values, mixed.values)
    for column in staying:
        values[:, :, column] = np.where(replaced, mixed.values[:, :, column], values[:, :, column])
    mixed.values[:] = values
    mixed.types[other] = donors.types[other]
    for name in OUTLINE:
        getattr(mixed, name)[other] = getattr(donors, name)[other]


def _set_outlines(mixed: LevelData, donors: Levels) -> None:
    """Take the shapes of donors, with the sizes that follow from them, in place."""
    for name in OUTLINE:
        getattr(mixed, name)[:] = getattr(donors, name)
    if Size in mixed.layout.columns:
        size = mixed.layout.columns[Size]
        mixed.values[:, :, size] = donors.values[:, :, size]


def _differ(levels: Levels, mixed: LevelData) -> np.ndarray:
    """Whether a level is another one, bool ``(n,)``; with other rules each is."""
    if mixed.world is not levels.world and (mixed.world is None or mixed.world.space is None):
        return np.ones(len(levels), np.bool_)
    return differing(levels, vars(mixed), ("types", "values", "parameters", *OUTLINE))
