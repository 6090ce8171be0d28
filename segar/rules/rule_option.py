"""Options of a rule space: rules that hold together in a level, or not at all, with their constants."""

import string
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from numbers import Real
from typing import Any

import numpy as np

from segar.errors import FactorError, RuleError, did_you_mean
from segar.language import Parameter, Rule, as_rule
from segar.noise import Deterministic, Noise
from segar.rules.constants import Activity, activity


@dataclass(frozen=True, eq=False, init=False, repr=False)
class RuleOption:
    """Rules that hold together in a level, or not at all.

    Args:
        name: of the option; ``wind`` makes the parameter ``wind_active``. None: the name of the only rule.
        rules: rules or typed functions, one or several.
        constants: world parameters that these rules take, to a number or to the distribution from which each level in
            which the option is active draws it. Where the option is not active the parameter has its default.
        on_contact: rules that note a contact; see :class:`segar.World`.
        weight: how likely the option is compared with others; see :class:`RuleSpace`.
        words: what the rules do, for people; ``{name}`` stands for the value of the constant of that name.

    Raises:
        RuleError: there is no rule, no rule takes a constant, the weight is no positive number, or the words name what is
            no constant.
        FactorError: a constant's value or distribution does not suit it.
    """

    name: str
    rules: tuple[Rule, ...]
    constants: Mapping[type[Parameter], Noise]
    on_contact: tuple[Rule, ...]
    weight: float
    words: str
    active: type[Activity] = field(repr=False)

    def __init__(
        self,
        name: str | None = None,
        rules: Any = (),
        constants: Mapping[type[Parameter], Any] | None = None,
        on_contact: Any = (),
        weight: float = 1.0,
        words: str = "",
    ) -> None:
        set_ = object.__setattr__
        set_(self, "rules", _rules(rules))
        set_(self, "on_contact", _rules(on_contact))
        together = self.rules + self.on_contact
        if not together:
            raise RuleError(f"the option {name!r} of a rule space has no rule; give it rules=... or on_contact=...")
        set_(self, "name", together[0].name if name is None and len(together) == 1 else name)
        if self.name is None:
            raise RuleError(f"an option of {len(together)} rules ({', '.join(r.name for r in together)}) needs a name")
        set_(self, "active", activity(self.name))
        if isinstance(weight, bool) or not isinstance(weight, Real) or not 0 < weight < np.inf:
            raise RuleError(f"the option '{self.name}': its weight must be a positive number, not {weight!r}")
        set_(self, "weight", float(weight))
        given = {} if constants is None else constants
        if not isinstance(given, Mapping):
            raise RuleError(
                f"the option '{self.name}': constants must be a mapping such as {{Gravity: 10.0}}, not {constants!r}"
            )
        set_(self, "constants", {p: _law(self.name, p, value) for p, value in given.items()})
        taken = {p for rule in together for p in rule.signature.parameters}
        for parameter in self.constants:
            if parameter not in taken:
                names = [p.__name__ for p in taken]
                raise RuleError(
                    f"the option '{self.name}': none of its rules takes {parameter.__name__}."
                    f"{did_you_mean(parameter.__name__, names)}"
                )
        _require_words(self.name, words, [p.__name__ for p in self.constants])
        set_(self, "words", words or " and ".join(r.name.replace("_", " ") for r in together))

    def __repr__(self) -> str:
        constants = ", ".join(f"{p.__name__}: {law!r}" for p, law in self.constants.items())
        return f"RuleOption('{self.name}'{f', {{{constants}}}' if constants else ''})"


def same_options(options: Sequence[RuleOption]) -> list[tuple[str, str]]:
    """The names of pairs of options whose rules are one code for the same factors, and whose constants have the same laws."""
    first: dict[str, str] = {}
    pairs = []
    for option in options:
        does = repr([[_does(rule, option) for rule in rules] for rules in (option.rules, option.on_contact)])
        key = f"{does} {list(option.constants.values())}"
        if key in first:
            pairs.append((first[key], option.name))
        first.setdefault(key, option.name)
    return pairs


def _rules(given: Any) -> tuple[Rule, ...]:
    is_list = isinstance(given, Sequence) and not isinstance(given, str)
    return tuple(map(as_rule, given)) if is_list else (as_rule(given),)


def _require_words(option: str, words: Any, constants: Sequence[str]) -> None:
    """Raise :class:`RuleError` unless the words are a text in which only constants stand in braces."""
    try:
        fields = [field for _, field, _, _ in string.Formatter().parse(words) if field is not None]
        if set(fields) <= set(constants):
            words.format(**dict.fromkeys(constants, "1"))
    except (TypeError, ValueError) as error:
        raise RuleError(
            f"the option '{option}': its words must be a text with names of constants in braces, and {words!r} is none: {error}"
        ) from None
    for name in fields:
        if name not in constants:
            raise RuleError(
                f"the option '{option}': its words name {{{name}}}, which is no constant of it.{did_you_mean(name, constants)}"
            )


def _law(option: str, parameter: Any, value: Any) -> Noise:
    """The distribution of a constant; raises :class:`FactorError` where it does not suit the parameter."""
    if not (isinstance(parameter, type) and issubclass(parameter, Parameter)):
        raise RuleError(f"the option '{option}': {parameter!r} is not a world parameter class such as Gravity")
    place = f"the option '{option}': {parameter.__name__}"
    if not isinstance(value, Noise):
        value = parameter.check(value)
        if not parameter.is_possible(np.array([value])).all():
            raise FactorError(f"{place} is {value!r}, and must be {parameter.possible_values()}")
        return Deterministic(value)
    if value.width != 1:
        raise FactorError(f"{place} needs a distribution on the line, not {value!r}")
    if not parameter.is_possible(np.array(value.support)).all() and parameter.bounds is not None:
        raise FactorError(
            f"{place} has the distribution {value!r}, which gives numbers from {value.support[0]:g} to {value.support[1]:g};"
            f" it must be {parameter.possible_values()}"
        )
    return value


def _does(rule: Rule, option: RuleOption) -> tuple[Any, ...]:
    """What a rule is, whatever its option and the constants are called."""
    function, own = rule.function, [id(parameter) for parameter in option.constants]
    cells = [cell.cell_contents for cell in function.__closure__ or ()]
    held = [value for value in (*cells, *function.__annotations__.values()) if id(value) not in own]
    return function.__code__, held, rule.relation, rule.priority
