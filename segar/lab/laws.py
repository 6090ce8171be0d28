"""Laws: answers as data, options and constants of the rule space or code, as levels in which their rules hold."""

import ast
import math
from collections.abc import Mapping, Sequence
from types import FunctionType
from typing import Any

import numpy as np

from segar.errors import SegarError
from segar.lab.hidden_world import Lab
from segar.language import Rule
from segar.levels import Levels
from segar.rules import RuleSpace
from segar.support import require_form

EMPTY: dict[str, Any] = {"options": {}}
DIGIT = math.log2(10)  # [bits] of a decimal digit
CHARACTER = 8  # [bits] of code


def levels_of(lab: Lab, laws: Sequence[Any]) -> Levels:
    """Levels in which these laws hold, one each. Options and constants are world parameters, so nothing is compiled.

    Args:
        laws: ``{"options": {name: {constant: value}}}`` each; or one alone, ``{"code": text}``, where the lab trusts it.

    Raises:
        SegarError: a law is none; the message names what is wrong with it.
    """
    if len(laws) == 1 and isinstance(laws[0], Mapping) and "code" in laws[0]:
        return lab.in_world([*lab.space.always, *_rules_in(lab, laws[0])])
    if not laws:
        raise SegarError("'laws' is empty, and must hold one law at least")
    layout = lab.hidden.layout
    columns = {p: layout.parameters.index(p) for p in lab.space.parameters}
    first = lab.hidden.parameters[0].copy()
    for parameter, column in columns.items():
        first[column] = parameter.default
    parameters = np.tile(first, (len(laws), 1))
    form = {f"{name}?": dict.fromkeys(own, float) for name, own in lab.ranges.items()}
    for row, law in zip(parameters, laws, strict=True):
        for name, constants in _checked(lab, law, form).items():
            option = lab.space.options[lab.space.index(name)]
            row[columns[option.active]] = 1.0
            for parameter in option.constants:
                row[columns[parameter]] = constants[parameter.__name__]
    return lab.hidden[[0] * len(laws)].with_parameters(parameters)


def law_in(levels: Levels, space: RuleSpace) -> dict[str, Any]:
    """The law that holds in a single level of the rule space, as data."""
    columns = [levels.layout.parameters.index(p) for p in space.parameters]
    return laws_of(space, levels.parameters[:1, columns])[0]


def laws_of(space: RuleSpace, values: np.ndarray) -> list[dict[str, Any]]:
    """The laws of parameters as :meth:`segar.rules.RuleSpace.sample` gives them, float64 ``(n, parameters)``, as data."""
    columns = {p: k for k, p in enumerate(space.parameters)}
    names = {o.name: (columns[o.active], {p.__name__: columns[p] for p in o.constants}) for o in space.options}
    return [
        {"options": {name: {c: row[k] for c, k in own.items()} for name, (active, own) in names.items() if row[active]}}
        for row in values.tolist()
    ]


def bits_of(lab: Lab, law: Mapping[str, Any]) -> float:
    """Description length [bits]: which options hold and the digits of their constants, or the characters of the code."""
    if "code" in law:
        return float(CHARACTER * len(ast.unparse(ast.parse(law["code"]))))
    digits = sum(_digits(value) for constants in law["options"].values() for value in constants.values())
    return len(law["options"]) * math.log2(len(lab.space.options)) + digits * DIGIT


def _digits(value: float) -> int:
    """The decimal digits of a number as it is written, zeros at either end left out; one at least."""
    return max(1, len(repr(float(value)).split("e")[0].lstrip("-").replace(".", "").strip("0")))


def _checked(lab: Lab, law: Any, form: Mapping[str, Any]) -> Mapping[str, Mapping[str, float]]:
    """The options of a law, which fit the rule space; raises :class:`SegarError`."""
    if isinstance(law, Mapping) and "code" in law:
        raise SegarError("a law with 'code' is graded alone, not among others")
    require_form(law, {"options": form}, "law", only=True)
    options = law["options"]
    for name, chosen in options.items():
        for constant, value in chosen.items():
            low, high = lab.ranges[name][constant]
            if not low <= value <= high:
                at = f"'law.options.{name}.{constant}'"
                raise SegarError(f"{at} is {value:g}, and must be from {low:g} to {high:g}")
    for group in lab.space.exclusive:
        meet = [lab.space.names[k] for k in group if lab.space.names[k] in options]
        if len(meet) > 1:
            raise SegarError(f"'law.options': {' and '.join(meet)} never hold together; leave one out")
    return options


def _rules_in(lab: Lab, law: Mapping[str, Any]) -> list[Rule | FunctionType]:
    """The rules that the code of a law defines. The code is executed."""
    if not lab.trusted:
        raise SegarError("'law.code': this lab does not trust code; answer with 'options'")
    require_form(law, {"code": str}, "law", only=True)
    names: dict[str, Any] = {"__name__": "answer"}
    try:
        exec(compile(law["code"], "<answer>", "exec"), names)
    except Exception as error:  # the code of others may raise anything
        raise SegarError(f"'law.code' cannot be executed: {type(error).__name__}: {error}") from error
    functions = [(value.function if isinstance(value, Rule) else value, value) for value in names.values()]
    rules = [value for function, value in functions if getattr(function, "__module__", None) == "answer"]
    if not rules:
        raise SegarError("'law.code' defines no rule")
    return rules
