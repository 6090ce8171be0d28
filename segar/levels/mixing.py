"""Levels between two sets: some groups of factors are those of one level, all else is that of another."""

import dataclasses
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from segar.errors import LevelError, did_you_mean
from segar.levels.level_data import OUTLINE, LevelData, Provenance
from segar.levels.level_set import Levels
from segar.support import __version__

REST, SEPARATOR = "rest", "+"  # what no group of factors names; between the names of groups that are changed
# No names of groups: the tables of an attribution have columns called so.
RESERVED_GROUPS = (REST, "pair", "value", "total")

RULES = "World"  # stands for the rules in a group of factors

Groups = Mapping[str, Sequence[Any]]
"""Name to factors and world parameters, as classes or by name; ``World`` (``segar.World``) stands for the rules, with which
options of a rule space are active and their constants. What no group names is the group "rest": types of entities, outlines
of hulls, and all other factors."""


def mixed_levels(train: Levels, test: Levels, groups: Groups, chosen: Mapping[str, Any]) -> Levels:
    """Level i of ``train`` with the factors of ``chosen`` groups from level i of ``test``.

    A factor passes where the entities of both levels have it. With all groups chosen, these are the test levels; with
    none, the training levels. Things stay where they are put, even if they overlap.

    Args:
        train, test: as many of each, in the same slots.
        chosen: name of a group, "rest" included, to whether it is from ``test``.

    Raises:
        LevelError: the sets do not fit each other, or a group names what is not there, or twice.
    """
    check_fits(train, test)
    columns, parameters = places(train, groups)
    owner = test if chosen.get(REST) else train
    arrays = {name: getattr(owner, name).copy() for name in ("types", "values", *OUTLINE)}
    table = owner.parameters.copy()
    for name in groups:
        source = test if chosen.get(name) else train
        for column in columns[name]:
            there = np.isfinite(arrays["values"][:, :, column]) & np.isfinite(source.values[:, :, column])
            arrays["values"][:, :, column] = np.where(
                there, source.values[:, :, column], arrays["values"][:, :, column]
            )
        for column in parameters[name]:
            table[:, column] = source.parameters[:, column]
    train.layout.set_floor(arrays["values"], table)
    of_rules = next((name for name, members in groups.items() if RULES in map(_name, members)), REST)
    world = (test if chosen.get(of_rules) else train).world
    made = Provenance("between training and test", "", __version__, 0, "", np.arange(len(train)))
    arrays |= {"parameters": table, "sampled_values": arrays["values"].copy()}
    return dataclasses.replace(train, **arrays, world=world, provenance=made, distribution=None, moments={})


def differing(levels: LevelData, arrays: Mapping[str, np.ndarray], names: Sequence[str]) -> np.ndarray:
    """Which levels have other numbers than ``arrays`` in those of these names, bool ``(n,)``."""
    found = np.zeros(len(levels), np.bool_)
    for name in names:
        ours, theirs = (np.nan_to_num(one).reshape(len(levels), -1) for one in (getattr(levels, name), arrays[name]))
        found |= (ours != theirs).any(axis=1)
    return found


def with_room(levels: Levels, others: LevelData) -> Levels:
    """The same levels, with room for the vertices of the others."""
    lacking = max(0, others.vertices.shape[2] - levels.vertices.shape[2])
    return dataclasses.replace(levels, vertices=np.pad(levels.vertices, ((0, 0), (0, 0), (0, lacking), (0, 0))))


def check_fits(train: Levels, test: Levels) -> None:
    """Raises :class:`LevelError` unless levels of one set can be mixed with those of the other."""
    if train.layout != test.layout or train.vertices.shape[2:] != test.vertices.shape[2:]:
        raise LevelError("training and test levels have different slots, types or parameters: they cannot be mixed")
    if len(train) != len(test):
        raise LevelError(f"there are {len(train)} training levels but {len(test)} test levels; give pairs")


def places(levels: Levels, groups: Groups) -> tuple[dict[str, list[int]], dict[str, list[int]]]:
    """The columns of ``values`` and of ``parameters`` that each group names."""
    layout = levels.layout
    known = [parameter.__name__ for parameter in layout.parameters]
    space = None if levels.world is None else levels.world.space
    of_rules = () if space is None else tuple(parameter.__name__ for parameter in space.parameters)
    columns: dict[str, list[int]] = {}
    parameters: dict[str, list[int]] = {}
    seen: dict[str, str] = {}
    for name, members in groups.items():
        if name in RESERVED_GROUPS:
            raise LevelError(f"a group cannot be called '{name}'")
        columns[name], parameters[name] = [], []
        named = [_name(member) for member in members]
        for factor in (*named, *(of_rules if RULES in named else ())):
            if factor in seen:
                raise LevelError(f"{factor} is in the groups '{seen[factor]}' and '{name}'; it can be in one alone")
            seen[factor] = name
            if factor in layout.by_name:
                kind, first = layout.by_name[factor]
                columns[name] += range(first, first + kind.width)
            elif factor in known:
                parameters[name].append(known.index(factor))
            elif factor != RULES:
                near = did_you_mean(factor, [*layout.by_name, *known, RULES])
                raise LevelError(f"group '{name}': these levels have no factor or parameter '{factor}'.{near}")
    return columns, parameters


def _name(member: Any) -> str:
    return member if isinstance(member, str) else member.__name__
