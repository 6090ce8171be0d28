"""Checks of settings, which stand in the types of the fields: ``count: Count`` is an int that is at least 1.

A check is a function of a setting's dotted path and value. It raises :class:`ConfigError` with the path, the value and what the
value must be.
"""

import dataclasses
import re
from collections.abc import Callable, Iterable, Mapping
from functools import cache, partial
from types import UnionType
from typing import Annotated, Any, ClassVar, Literal, Union, get_args, get_origin, get_type_hints

from segar.errors import did_you_mean
from segar.experiments.settings.errors import ConfigError
from segar.support import object_name

DESIGNS = ("iid", "clustered", "covering", "nuisance_only")  # kinds of segar.design that need no test levels
# Training sets that are like independent ones or unlike them in distance, and in coverage: in standard deviations of the
# measures of segar.metrics.matched_set.
MATCHED_DESIGNS: Mapping[str, Mapping[str, Any]] = {
    "matched": {"w2": 0.0, "radius": 0.0, "effective_number": 0.0},
    "matched_far_1.5": {"w2": 1.5, "radius": 0.0, "effective_number": 0.0},
    "matched_far": {"w2": 3.0, "radius": 0.0, "effective_number": 0.0},
    "matched_far_4.5": {"w2": 4.5, "radius": 0.0, "effective_number": 0.0},
    "matched_sparse_1.5": {"w2": 0.0, "radius": 1.5, "effective_number": -1.0},
    "matched_sparse": {"w2": 0.0, "radius": 3.0, "effective_number": -2.0},
    "matched_far_sparse": {"w2": 3.0, "radius": 3.0, "effective_number": -2.0},
}
RULE_SETS_DESIGN = re.compile(r"rule_sets_([1-9]\d*)(?:_(near|far))?")  # how many rule sets the training levels share
MECHANISM_DESIGN = re.compile(r"(\w+)_of_test_(100|[1-9]\d?)")  # and the share of levels that have it [%]
TARGET_DESIGN = re.compile(r"w2_(x?)(\d+(?:\.\d+)?)")  # the kind target of segar.design, in the mode exact
ENDLESS = "endless"  # the levels.count of a stream in which no level comes twice
SEEDS = 2**63  # how many different seeds all generators take

Check = Callable[[str, Any], None]


def require(holds: bool, place: str, value: Any, wanted: str) -> None:
    """Raises :class:`ConfigError` unless ``holds``."""
    if not holds:
        raise ConfigError(f"{place}: {value!r} is not allowed; it must be {wanted}")


def require_known(place: str, name: str, names: Iterable[str], own: bool = False) -> None:
    """Raises :class:`ConfigError` that names the nearest of ``names``, unless ``name`` is one of them; or, with ``own``, that
    of an object of the user's own, ``module:attribute``."""
    known = list(dict.fromkeys(names))
    if name not in known and not (own and object_name(name)):
        raise ConfigError(f"{place}: '{name}' is unknown.{did_you_mean(name, known)}")


def require_design(place: str, name: str) -> None:
    """Raises :class:`ConfigError` unless ``name`` is in DESIGNS or MATCHED_DESIGNS, says a W2 between training and test
    levels, a number of rule sets or a mechanism of the test, or is the ``module:function`` of a design of the user's own.

    ``w2_4.2`` is that distance; ``w2_x1.2`` is 1.2 times the mean distance of independent sets of as many levels;
    ``rule_sets_10`` are levels that share ten rule sets; ``rule_sets_10_near`` and ``rule_sets_10_far`` pick them;
    ``Mass_of_test_30`` are levels of which 30 % have masses as the test distribution has them.
    """
    if object_name(name) or RULE_SETS_DESIGN.fullmatch(name) or MECHANISM_DESIGN.fullmatch(name):
        return
    if target := TARGET_DESIGN.fullmatch(name):
        require(float(target[2]) > 0, place, name, "a distance above 0")
    elif name.startswith("rule_sets"):
        raise ConfigError(f"{place}: '{name}' says no number of rule sets; rule_sets_10 does, and rule_sets_10_near")
    elif name.startswith("w2_"):
        raise ConfigError(
            f"{place}: '{name}' says no distance; w2_4.2 does, and w2_x1.2, 1.2 times that of independent sets"
        )
    else:
        require_known(place, name, (*DESIGNS, *MATCHED_DESIGNS))


def require_seed(place: str, seed: int) -> None:
    """Raises :class:`ConfigError` unless all generators take ``seed``."""
    require(0 <= seed < SEEDS, place, seed, f"0 or more, and less than {SEEDS}")


@dataclasses.dataclass(frozen=True, eq=False)
class InSchema:
    """A check, and what the JSON schema of files says of it."""

    check: Check
    said: Mapping[str, Any]

    def __call__(self, place: str, value: Any) -> None:
        self.check(place, value)

    def __get_pydantic_json_schema__(self, schema: Any, handler: Callable[[Any], dict[str, Any]]) -> dict[str, Any]:
        return {**handler(schema), **self.said}


def that(holds: Callable[[Any], bool], wanted: str) -> InSchema:
    """The check that ``holds`` is true of a value; ``wanted`` completes "it must be"."""

    def check(place: str, value: Any) -> None:
        require(holds(value), place, list(value) if isinstance(value, tuple) else value, wanted)

    return InSchema(check, {"$comment": f"must be {wanted}"})


def one_of(*names: str) -> InSchema:
    """The check that a value is one of ``names``."""
    return InSchema(partial(require_known, names=names), {"enum": list(names)})


def one_or_own(names: Iterable[str]) -> Check:
    """The check that a value is one of ``names``, or ``module:attribute``."""
    return partial(require_known, names=names, own=True)


Count = Annotated[int, that(lambda n: n >= 1, "at least 1")]
LevelCount = Annotated[int | Literal["endless"], that(lambda n: n == ENDLESS or n >= 1, "at least 1, or endless")]
CountFrom0 = Annotated[int, that(lambda n: n >= 0, "0 or more")]
Positive = Annotated[float, that(lambda x: x > 0, "more than 0")]
PositiveOrNull = Annotated[float | None, that(lambda x: x is None or x > 0, "more than 0, or null")]
NotNegative = Annotated[float, that(lambda x: x >= 0, "0 or more")]
Share = Annotated[float, that(lambda x: 0 <= x <= 1, "between 0 and 1")]
Window = Annotated[float, that(lambda x: 0 < x <= 1, "more than 0, and at most 1")]
Samples = Annotated[int, that(lambda n: n >= 8, "at least 8")]  # candidates of a planner's search
Seed = Annotated[int, require_seed]
Widths = Annotated[tuple[int, ...], that(lambda w: bool(w) and min(w) >= 1, "one or more numbers, each at least 1")]


class Settings:
    """A group of settings: a dataclass whose values are checked when it is made."""

    group: ClassVar[str] = ""  # the dotted path of the group in a run's settings

    def __post_init__(self) -> None:
        for name, hint in hints_of(type(self)).items():
            check_value(getattr(self, name), hint, path_of(self.group, name))


def check_value(value: Any, hint: Any, place: str) -> None:
    """Applies the checks of a type to a value, or to each entry of a tuple."""
    if get_origin(hint) is Annotated:
        hint, *checks = get_args(hint)
        for check in checks:
            check(place, value)
    if get_origin(hint) in (UnionType, Union) and value is not None:
        check_value(value, next(one for one in get_args(hint) if one is not type(None)), place)
    if get_origin(hint) is tuple and value is not None:
        for i, entry in enumerate(value):
            check_value(entry, get_args(hint)[0], f"{place}[{i}]")


@cache
def hints_of(cls: type) -> Mapping[str, Any]:
    """The types of the fields of a dataclass, with the checks that stand in them."""
    hints = get_type_hints(cls, include_extras=True)
    return {field.name: hints[field.name] for field in dataclasses.fields(cls)}


def path_of(place: str, name: Any) -> str:
    """The dotted path of the setting ``name`` in the group ``place``, which may be empty."""
    return f"{place}.{name}" if place else str(name)
