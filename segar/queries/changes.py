"""Changes of one thing: a factor of an entity, a world parameter, a rule, or an action. Each is data, and says itself in words;
and which ones are tried, drawn at random.

A change takes place before the first step.
"""

from collections.abc import Callable, Iterator, Mapping
from dataclasses import asdict, dataclass, field, replace
from functools import partial
from typing import Any, ClassVar, Protocol, TypeAlias

import numpy as np

from segar.errors import FactorError, LevelError, SegarError, did_you_mean
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
from segar.levels import Levels, active_options, rule_space_of
from segar.noise import Noise
from segar.queries.question import draw_actions
from segar.queries.words import option_in_words, parameter_value, rounded, stated_parameters, vector, with_unit
from segar.rules import RuleOption
from segar.support import misfit

FACTORS = (0.25, 0.5, 2.0, 4.0)  # by which a number is multiplied
FROM_ZERO = (0.5, 1.0)  # what a number becomes that is 0
SIGNED = (Charge, Magnetism, StoredEnergy)  # factors that may become negative
NOT_CHANGED = (Size, Count)  # of factors: the outline belongs to the size
TECHNICAL = (Framerate, MinMass, MinVelocity)  # parameters of the simulation rather than of the physics

Case: TypeAlias = tuple[Levels, np.ndarray]
"""A single level, and the actions that are taken on it, float ``(steps, action size)``."""


class Change(Protocol):
    """What all changes can do."""

    what: ClassVar[str]

    def applied(self, level: Levels, actions: np.ndarray) -> Case:
        """The level and the actions with this change; raises :class:`SegarError` where it does not fit them."""
        ...

    def words(self, level: Levels, actions: np.ndarray) -> str:
        """What is different after the change, as a part of a sentence."""
        ...


@dataclass(frozen=True)
class FactorChange:
    """A factor of an entity, one number, has another value."""

    what: ClassVar[str] = "factor"
    entity: str
    factor: str
    value: float

    def applied(self, level: Levels, actions: np.ndarray) -> Case:
        slot, factor = self._place(level)
        values = level.values.copy()
        values[0, slot, level.layout.columns[factor]] = checked(factor, self.value)
        return replace(level, values=values), actions

    def words(self, level: Levels, actions: np.ndarray) -> str:
        slot, factor = self._place(level)
        before = level.values[0, slot, level.layout.columns[factor]]
        return (
            f"{self.factor} of {self.entity} is {with_unit(self.value, factor)} instead of {with_unit(before, factor)}"
        )

    def _place(self, level: Levels) -> tuple[int, type[Factor]]:
        slot, factor = level.layout.slot_index(self.entity), level.layout.factor(self.factor)
        if factor.width != 1 or np.isnan(level.values[0, slot, level.layout.columns[factor]]):
            raise LevelError(f"'{self.entity}' has no {self.factor} that is one number")
        return slot, factor


@dataclass(frozen=True)
class ParameterChange:
    """A world parameter, which may be a constant of a rule, has another value."""

    what: ClassVar[str] = "parameter"
    parameter: str
    value: float

    def applied(self, level: Levels, actions: np.ndarray) -> Case:
        parameter = parameter_of(level, self.parameter)
        return with_parameters(level, {parameter: checked(parameter, self.value)}), actions

    def words(self, level: Levels, actions: np.ndarray) -> str:
        parameter = parameter_of(level, self.parameter)
        before = parameter_value(level, parameter)
        text = f"{self.parameter} is {with_unit(self.value, parameter)} instead of {with_unit(before, parameter)}"
        option = option_of(level, parameter)
        if option is None:
            return text
        constants = {p.__name__: parameter_value(level, p) for p in option.constants}
        return f"{text}; it is in the rule that says now: {option_in_words(option, constants | {self.parameter: self.value})}"


@dataclass(frozen=True)
class RuleChange:
    """A rule of the level's rule space holds that did not, with these constants; or one that held does not."""

    what: ClassVar[str] = "rule"
    option: str
    active: bool
    constants: Mapping[str, float] = field(default_factory=dict)

    def applied(self, level: Levels, actions: np.ndarray) -> Case:
        space = rule_space_of(level)
        option = space.options[space.index(self.option)]
        if (parameter_value(level, option.active) != 0) == self.active:
            raise LevelError(f"the rule '{self.option}' {'holds already' if self.active else 'does not hold here'}")
        known = {p.__name__: p for p in option.constants}
        needed = set(known) if self.active else set()
        for name in sorted(needed ^ set(self.constants)):
            raise LevelError(
                f"the constants of the rule '{self.option}' are {sorted(needed)}, and '{name}' is not as they say"
            )
        new: dict[type[Parameter], float] = {p: p.default for p in known.values()}
        new |= {known[name]: checked(known[name], value) for name, value in self.constants.items()}
        return with_parameters(level, {option.active: float(self.active), **new}), actions

    def words(self, level: Levels, actions: np.ndarray) -> str:
        space = rule_space_of(level)
        option = space.options[space.index(self.option)]
        constants = self.constants or {p.__name__: parameter_value(level, p) for p in option.constants}
        rule = option_in_words(option, constants)
        return f"there is one more rule: {rule}" if self.active else f"one rule does not hold: {rule}"


@dataclass(frozen=True)
class ActionChange:
    """The action of one step, counted from 1, is another."""

    what: ClassVar[str] = "action"
    step: int
    action: list[float]

    def applied(self, level: Levels, actions: np.ndarray) -> Case:
        if not 1 <= self.step <= len(actions) or len(self.action) != actions.shape[1]:
            raise SegarError(
                f"there are {len(actions)} actions of {actions.shape[1]} numbers, and none is changed by action {self.step} of"
                f" {len(self.action)} numbers"
            )
        changed = actions.copy()
        changed[self.step - 1] = self.action
        return level, changed

    def words(self, level: Levels, actions: np.ndarray) -> str:
        return f"the action of step {self.step} is {vector(self.action)} instead of {vector(actions[self.step - 1])}"


KINDS: dict[str, type[Any]] = {kind.what: kind for kind in (FactorChange, ParameterChange, RuleChange, ActionChange)}
FORMS: dict[str, dict[str, Any]] = {
    "factor": {"what": str, "entity": str, "factor": str, "value": float},
    "parameter": {"what": str, "parameter": str, "value": float},
    "rule": {"what": str, "option": str, "active": bool, "constants": {str: float}},
    "action": {"what": str, "step": int, "action": [float]},
}


def change_data(change: Change) -> dict[str, Any]:
    """A change as plain data."""
    return {"what": change.what, **asdict(change)}  # type: ignore[call-overload]


def change_of(data: Any, at: str) -> Change:
    """The change that plain data name.

    Args:
        at: where the data stand, for messages.

    Raises:
        SegarError: the data are no change; the message names the field.
    """
    wrong = misfit(data, {"what": str}, at)
    if wrong is None and data["what"] not in KINDS:
        wrong = f"'{at}.what': there is no change of '{data['what']}'.{did_you_mean(data['what'], KINDS)}"
    if wrong := wrong or misfit(data, FORMS[data["what"]], at, only=True):
        raise SegarError(wrong)
    return KINDS[data["what"]](**{name: value for name, value in data.items() if name != "what"})


def parameter_of(level: Levels, name: str) -> type[Parameter]:
    """The world parameter of that name; raises :class:`LevelError`."""
    known = {p.__name__: p for p in level.layout.parameters}
    if name not in known:
        raise LevelError(f"these levels have no world parameter '{name}'.{did_you_mean(name, known)}")
    return known[name]


def option_of(level: Levels, parameter: type[Parameter]) -> RuleOption | None:
    """The option of the level's rule space that has this constant; None where there is none."""
    space = None if level.world is None else level.world.space
    return None if space is None else next((o for o in space.options if parameter in o.constants), None)


def with_parameters(level: Levels, new: Mapping[type[Parameter], float]) -> Levels:
    """A single level with other values of some world parameters."""
    parameters, values = level.parameters.copy(), level.values.copy()
    for parameter, value in new.items():
        parameters[0, level.layout.parameters.index(parameter)] = value
    level.layout.set_floor(values, parameters)
    return replace(level, parameters=parameters, values=values)


def checked(factor: type[Factor], value: float) -> float:
    """The value, if the factor can have it; raises :class:`FactorError`."""
    if not factor.is_possible(np.array([value])).all():
        raise FactorError(f"{factor.__name__} is {value:g} after the change, and must be {factor.possible_values()}")
    return float(value)


# Which changes are tried.

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
