"""Which changes are tried: of factors, parameters, rules and actions of a level, drawn at random."""

from collections.abc import Callable, Iterator, Mapping
from functools import partial

import numpy as np

from segar.language import (
    Charge,
    Count,
    Factor,
    Framerate,
    Magnetism,
    MinMass,
    MinVelocity,
    Parameter,
    Scalar,
    Size,
    StoredEnergy,
    Task,
)
from segar.levels import Levels, active_options
from segar.noise import Noise
from segar.queries.changes import ActionChange, Change, FactorChange, ParameterChange, RuleChange, parameter_value
from segar.queries.numbers import rounded
from segar.queries.question import draw_actions
from segar.queries.words import stated_parameters

FACTORS = (0.25, 0.5, 2.0, 4.0)  # by which a number is multiplied
FROM_ZERO = (0.5, 1.0)  # what a number becomes that is 0
SIGNED = (Charge, Magnetism, StoredEnergy)  # factors that may become negative
NOT_CHANGED = (Size, Count)  # of factors: the outline belongs to the size
TECHNICAL = (Framerate, MinMass, MinVelocity)  # parameters of the simulation rather than of the physics

Draw = Callable[[], Change | None]


def draw_changes(
    level: Levels, task: Task, actions: np.ndarray, rng: np.random.Generator, number: int, with_actions: bool = False
) -> list[Change]:
    """At most ``number`` different changes of a single level; first the sort of a change is drawn, then what changes.

    Args:
        with_actions: whether an action may be changed.
    """
    sorts = [list(sort(level, rng)) for sort in (_factor_changes, _parameter_changes, _rule_changes)]
    if with_actions:
        sorts.append([lambda step=step: _action_change(task, actions, step, rng) for step in range(len(actions))])
    sorts = [sort for sort in sorts if sort]
    found: list[Change] = []
    for _ in range(number if sorts else 0):
        sort = sorts[rng.integers(len(sorts))]
        change = sort[rng.integers(len(sort))]()
        if change is not None and change not in found:
            found.append(change)
    return found


def _factor_changes(level: Levels, rng: np.random.Generator) -> Iterator[Draw]:
    layout = level.layout
    for slot in np.flatnonzero(level.types[0, :-1] >= 0).tolist():
        for factor, column in layout.columns.items():
            before = level.values[0, slot, column]
            if issubclass(factor, Scalar) and not issubclass(factor, NOT_CHANGED) and not np.isnan(before):
                make = partial(FactorChange, layout.names[slot], factor.__name__)
                yield partial(_with_value, make, factor, before, rng)


def _parameter_changes(level: Levels, rng: np.random.Generator) -> Iterator[Draw]:
    for parameter in stated_parameters(level):
        if parameter not in TECHNICAL:
            make = partial(ParameterChange, parameter.__name__)
            yield partial(_with_value, make, parameter, parameter_value(level, parameter), rng)


def _rule_changes(level: Levels, rng: np.random.Generator) -> Iterator[Draw]:
    space = None if level.world is None else level.world.space
    if space is None:
        return
    active = active_options(level)[0]
    switches = [option.active for option, holds in zip(space.options, active, strict=True) if holds]
    for option, holds in zip(space.options, active, strict=True):
        if holds:
            yield partial(RuleChange, option.name, False)
            yield from (partial(_other_constant, level, p, space.laws[p], rng) for p in option.constants)
        elif all(space.may_meet(option.active, other) for other in switches):
            laws = {p.__name__: space.laws[p] for p in option.constants}
            yield partial(_switched_on, option.name, laws, rng)


def _with_value(
    make: Callable[[float], Change], factor: type[Factor], before: float, rng: np.random.Generator
) -> Change | None:
    """A change to another value; None where that is not possible."""
    value = rounded(before * rng.choice(FACTORS) if before else rng.choice(FROM_ZERO))
    if issubclass(factor, SIGNED) and rng.random() < 0.5:
        value = -value
    return make(value) if value != before and factor.is_possible(np.array([value])).all() else None


def _other_constant(level: Levels, parameter: type[Parameter], law: Noise, rng: np.random.Generator) -> Change | None:
    """A constant of an active option with another value of its distribution; None where the same is drawn."""
    value = _drawn(law, rng)
    return ParameterChange(parameter.__name__, value) if value != parameter_value(level, parameter) else None


def _switched_on(option: str, laws: Mapping[str, Noise], rng: np.random.Generator) -> Change:
    return RuleChange(option, True, {name: _drawn(law, rng) for name, law in laws.items()})


def _drawn(law: Noise, rng: np.random.Generator) -> float:
    return float(np.asarray(law.sample(rng, 1)).ravel()[0])


def _action_change(task: Task, actions: np.ndarray, step: int, rng: np.random.Generator) -> Change | None:
    action = draw_actions(task, 1, rng)[0]
    return None if (action == actions[step]).all() else ActionChange(step + 1, action.tolist())
