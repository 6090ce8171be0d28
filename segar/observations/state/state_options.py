"""The options of state observations: which entities and factors are shown, and in which form."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, Literal, Self

import numpy as np

from segar import language
from segar.errors import FactorError, SegarError, did_you_mean
from segar.language import Entity, Factor, Layout, Parameter, Visible, concrete_factors
from segar.levels import Levels


def factors_of(
    where: str, given: Iterable[str | type[Factor]], kind: type[Factor] | None = Factor
) -> tuple[type[Factor], ...]:
    """The factor classes that are given by class or by name; a name stands for all classes that are called so.

    Args:
        where: who asks, for messages.
        kind: what is meant: factors of entities, world parameters (:class:`Parameter`), or both (None).

    Raises:
        FactorError: one is no factor, is of the other kind, has no number, or no factor is called so.
    """
    found: list[type[Factor]] = []
    for one in [given] if isinstance(given, str | type) else given:
        for factor in _called(where, one, kind) if isinstance(one, str) else [one]:
            if not (isinstance(factor, type) and issubclass(factor, Factor)):
                raise FactorError(f"{where}: {one!r} is not a factor")
            if not factor.width:
                raise FactorError(f"{where}: {factor.__name__} is not a number, so that no state shows it")
            if kind is not None and issubclass(factor, Parameter) != (kind is Parameter):
                raise FactorError(f"{where}: {OTHER_KIND[kind].format(factor.__name__)}")
            found.append(factor)
    return tuple(dict.fromkeys(found))


OTHER_KIND: Mapping[type[Factor], str] = {
    Factor: "{0} is a world parameter, which no entity has; write parameters=[{0}]",
    Parameter: "{0} is a factor of entities, not a world parameter; write factors=[{0}]",
}
"""What is said of a class of the other kind than what is meant."""


def _called(where: str, name: str, kind: type[Factor] | None) -> list[type[Factor]]:
    """The classes of that name, of that kind where there are such."""
    known = concrete_factors()
    found = [factor for factor in known if factor.__name__ == name]
    fitting = [factor for factor in found if kind is None or issubclass(factor, Parameter) == (kind is Parameter)]
    if found:
        return fitting or found
    noun = "world parameter" if kind is Parameter else "factor"
    names = [factor.__name__ for factor in known if kind is None or issubclass(factor, kind)]
    raise FactorError(f"{where}: no {noun} is called '{name}'.{did_you_mean(name, names)}")


def _of_levels(where: str, given: Any, kind: type[Factor] | None, layout: Layout) -> list[Any]:
    """What is given; for a name, of the classes that are called so, those that levels of this layout have.

    Raises:
        FactorError: several are called so, and the levels do not say which of them is meant.
    """
    if not isinstance(given, str):
        return [given]
    found, here = _called(where, given, kind), (*layout.factors, *layout.parameters)
    exact = [factor for factor in found if factor in here]
    chosen = exact or [factor for factor in found if any(issubclass(f, factor) for f in here)] or found
    if len(chosen) > 1 and kind is not None:
        places = ", ".join(sorted(f"{factor.__module__}.{factor.__qualname__}" for factor in chosen))
        raise FactorError(
            f"{where}: several classes are called '{given}' ({places}), and these levels do not say which is meant; give"
            " the class in place of its name, or rename all but one"
        )
    return chosen


HIDDEN: tuple[type[Factor], ...] = (
    language.Acceleration, language.Drag, language.Density, language.Done, language.InfiniteEnergy, language.Order, Visible,
)  # fmt: skip
"""Not shown unless asked for: they follow from others, concern drawing, or no rule reads them."""
FACTOR_LIMIT = 1e6  # values beyond are clipped, so that observations stay finite
MISSING_2022 = -1000.0  # what the implementation of 2022 puts where an entity lacks a factor
FORMS = ("vector", "table")
MASKS = (None, "numbers", "dict")


@dataclass(frozen=True)
class StateOptions:
    """The options of a :class:`segar.observations.state.state_vector.StateVector`, which says what each means.

    Raises:
        SegarError: an option is unknown, or a factor is no factor or has no number.
    """

    entities: Sequence[str | type[Entity]] | None = None
    factors: Sequence[str | type[Factor]] | None = None
    hidden: Sequence[str | type[Factor]] = ()
    form: Literal["vector", "table"] = "vector"
    slots: int | None = None
    types: bool | None = None
    missing: float = 0.0
    mask: Literal["numbers", "dict"] | None = None
    normalise: bool = False
    sees_invisible: bool = True
    parameters: Sequence[str | type[Parameter]] = ()
    scale: Mapping[str | type[Factor], float] = field(default_factory=dict)
    measured_on: Levels | None = None

    def __post_init__(self) -> None:
        for option, known in (("form", FORMS), ("mask", MASKS)):
            value = getattr(self, option)
            if value not in known:
                names = [str(k) for k in known]
                raise SegarError(f"StateVector has no {option} {value!r}.{did_you_mean(str(value), names)}")
        if self.slots is not None and (self.form != "table" or self.slots < 1):
            raise SegarError(
                f"StateVector: slots are the rows of a table, at least 1; not {self.slots} of a {self.form}"
            )
        if not np.isfinite(self.missing):
            raise SegarError(f"StateVector: missing must be a finite number, not {self.missing!r}; mask= marks it")
        if self.parameters and self.form == "table":
            raise SegarError(
                "StateVector: world parameters belong to no row of a table; show them beside it, as in"
                " {'table': StateVector(form='table'), 'world': StateVector(entities=[], parameters=[...])}"
            )
        if self.measured_on is not None and not isinstance(self.measured_on, Levels):
            raise SegarError(
                f"StateVector: measured_on must be a level set, segar.Levels, not {self.measured_on!r}; a run gives its own"
            )
        _ = self.chosen_factors, self.hidden_factors, self.chosen_parameters, self.scales  # raise for what is no factor

    def on(self, layout: Layout) -> Self:
        """The same options, with the classes of these levels in place of names of factors and parameters.

        Raises:
            FactorError: several classes have a name, and the levels do not say which of them is meant.
        """

        def classes(option: str, given: Iterable[Any], kind: type[Factor] | None) -> tuple[Any, ...]:
            given = [given] if isinstance(given, str | type) else given
            return tuple(f for one in given for f in _of_levels(f"StateVector: {option}", one, kind, layout))

        scale = {f: value for one, value in self.scale.items() for f in classes("scale", [one], None)}
        factors = None if self.factors is None else classes("factors", self.factors, Factor)
        hidden = classes("hidden", self.hidden, None)
        parameters = classes("parameters", self.parameters, Parameter)
        return replace(self, factors=factors, hidden=hidden, parameters=parameters, scale=scale)

    def shows(self, factor: type[Factor]) -> bool:
        """Whether the vector changes with the factor's values, of the entities shown that have it."""
        return self.has_number_of(factor) or (factor is Visible and not self.sees_invisible)

    def has_number_of(self, factor: type[Factor]) -> bool:
        """Whether the factor's or parameter's values are among the numbers, of the entities shown that have it."""
        if issubclass(factor, Parameter):
            return issubclass(factor, self.chosen_parameters) and not issubclass(factor, self.hidden_factors)
        chosen = self.chosen_factors is None or issubclass(factor, self.chosen_factors)
        return factor.width > 0 and chosen and not issubclass(factor, self.hidden_factors)

    @property
    def chosen_factors(self) -> tuple[type[Factor], ...] | None:
        """The classes of ``factors``; None stands for all."""
        return None if self.factors is None else factors_of("StateVector: factors", self.factors)

    @property
    def chosen_parameters(self) -> tuple[type[Parameter], ...]:
        """The classes of ``parameters``."""
        return factors_of("StateVector: parameters", self.parameters, Parameter)  # type: ignore[return-value]

    @property
    def scales(self) -> dict[type[Factor], float]:
        """The classes that ``scale`` names, and what their numbers are divided by."""
        if not isinstance(self.scale, Mapping):
            raise FactorError(f"StateVector: scale maps factors to numbers, as in {{Mass: 2.0}}, not {self.scale!r}")
        pairs = [(f, x) for one, x in self.scale.items() for f in factors_of("StateVector: scale", [one], None)]
        for factor, value in pairs:
            if isinstance(value, bool) or not isinstance(value, (int, float)) or not 0 < value < np.inf:
                raise FactorError(
                    f"StateVector: scale: {factor.__name__} is divided by a finite number above 0, not by {value!r}"
                )
        return {factor: float(value) for factor, value in pairs}

    def scale_of(self, factor: type[Factor]) -> float | None:
        """What the factor's numbers are divided by, by its nearest class in ``scale``; None where it names none."""
        return next((self.scales[kind] for kind in factor.__mro__ if kind in self.scales), None)

    @property
    def hidden_factors(self) -> tuple[type[Factor], ...]:
        """The classes of the factors that are not shown."""
        return (HIDDEN if self.factors is None else ()) + factors_of("StateVector: hidden", self.hidden, None)
