"""The rule sets of levels whose world has a rule space: which options are active, in words, and whether two sets share one."""

import dataclasses
from collections.abc import Sequence

import numpy as np

from segar.errors import LevelError
from segar.language import Parameter
from segar.levels.level_data import LevelData
from segar.levels.level_set import Levels
from segar.rules import RuleSpace
from segar.support import is_whole


def rule_space_of(levels: LevelData) -> RuleSpace:
    """The rule space of the levels' world; raises :class:`LevelError` where they have none."""
    space = None if levels.world is None else levels.world.space
    if space is None:
        raise LevelError(f"{levels!r} have one world for all; give them a rule space: distribution.with_rules(space)")
    return space


def active_options(levels: LevelData) -> np.ndarray:
    """Which options of their rule space are active in each level, bool ``(levels, options)``.

    Raises:
        LevelError: the levels have no rule space.
    """
    space = rule_space_of(levels)
    return _columns(levels, tuple(option.active for option in space.options)) != 0


def rules_in_words(levels: LevelData, index: int) -> tuple[str, ...]:
    """What the active options of a level do, one text each, with the constants of the level.

    Raises:
        LevelError: the levels have no rule space.
        IndexError: there is no such level.
    """
    space, active = rule_space_of(levels), active_options(levels)[index]
    values = dict(zip(levels.layout.parameters, levels.parameters[index].tolist(), strict=True))
    return tuple(
        option.words.format(**{p.__name__: f"{values[p]:g}" for p in option.constants})
        for option, is_active in zip(space.options, active, strict=True)
        if is_active
    )


def shared_rule_sets(a: LevelData, b: LevelData) -> np.ndarray:
    """Pairs of levels, one of each set, with one rule set: the same options, with the same constants.

    Returns:
        int64 ``(pairs, 2)``: for each level of ``a`` whose rule set is in ``b``, its index and that of the first such level.

    Raises:
        LevelError: the levels have no rule space, or not the same parameters.
    """
    names = [[p.__name__ for p in rule_space_of(levels).parameters] for levels in (a, b)]
    if names[0] != names[1]:
        raise LevelError(
            "the two level sets have rule spaces with other options or constants, so they share no rule set"
        )
    rows = [_columns(levels, rule_space_of(levels).parameters) for levels in (a, b)]
    first: dict[bytes, int] = {}
    for index, row in enumerate(rows[1]):
        first.setdefault(row.tobytes(), index)
    pairs = [(index, first[key]) for index, row in enumerate(rows[0]) if (key := row.tobytes()) in first]
    return np.array(pairs, dtype=np.int64).reshape(-1, 2)


def share_rule_sets(levels: Levels, rule_sets: int | Sequence[int] | np.ndarray) -> Levels:
    """The same levels with few rule sets, which they take in turns.

    Args:
        rule_sets: how many, those of the first levels: level i gets that of level i modulo the number, and those of a smaller
            number are among those of a greater one. Or the indices of the levels whose rule sets are shared.

    Raises:
        LevelError: the levels have no rule space, or ``rule_sets`` is no number from 1 to that of levels, nor indices of them.
    """
    columns = [levels.layout.parameters.index(p) for p in rule_space_of(levels).parameters]
    sources = _sources(rule_sets, len(levels))
    parameters = levels.parameters.copy()
    parameters[:, columns] = levels.parameters[np.resize(sources, len(levels))][:, columns]
    return dataclasses.replace(levels, parameters=parameters)


def _sources(rule_sets: int | Sequence[int] | np.ndarray, levels: int) -> np.ndarray:
    """The levels whose rule sets are shared, int64 ``(rule sets,)``."""
    if is_whole(rule_sets):
        if not 1 <= rule_sets <= levels:
            raise LevelError(f"rule sets: there must be 1 to {levels}, the number of levels, not {rule_sets}")
        return np.arange(rule_sets)
    found = np.asarray(rule_sets)
    if found.dtype.kind not in "iu" or found.ndim != 1 or not found.size or found.min() < 0 or found.max() >= levels:
        raise LevelError(
            f"rule sets: {rule_sets!r} is neither a number of them nor a list of levels from 0 to {levels - 1}"
        )
    return found


def _columns(levels: LevelData, parameters: tuple[type[Parameter], ...]) -> np.ndarray:
    return np.ascontiguousarray(levels.parameters[:, [levels.layout.parameters.index(p) for p in parameters]]) + 0.0
