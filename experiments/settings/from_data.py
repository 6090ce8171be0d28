"""From plain data (Hydra's result, or a run folder's ``config.yaml``) to the settings of a run."""

import dataclasses
import types
import typing
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, TypeVar

from segar.errors import did_you_mean
from segar.experiments.settings.algorithms import NAMES_OF_CLASS, algorithm_class
from segar.experiments.settings.checks import check_value, hints_of, path_of, require
from segar.experiments.settings.curricula import curriculum_class
from segar.experiments.settings.errors import ConfigError
from segar.experiments.settings.own_code import add_module_path, without_files
from segar.experiments.settings.run import RunConfig

T = TypeVar("T")
# The settings that may name objects and level files.
NAMING = ("levels", "task", "observation", "algorithm", "curriculum")


def run_config(data: Mapping[str, Any]) -> RunConfig:
    """The settings that plain data states.

    ``data["algorithm"]["kind"]`` names a built-in algorithm, ``data["algorithm"]["_target_"]`` the dataclass of another.

    Raises:
        ConfigError: a name, type or value is wrong.
    """
    add_module_path(one for one in data.get("module_path", ()) if isinstance(one, str))
    data = {key: without_files(value, key) if key in NAMING else value for key, value in data.items()}
    algorithm = _of_class(data.get("algorithm", {}), "algorithm", algorithm_class)
    stated = data.get("curriculum")
    curriculum = None if stated is None else _of_class(stated, "curriculum", curriculum_class)
    rest = {key: value for key, value in data.items() if key not in ("algorithm", "curriculum")}
    return construct(RunConfig, rest, "", algorithm=algorithm, curriculum=curriculum)


def _of_class(settings: Any, group: str, class_of: Callable[[Mapping[str, Any]], type[Any] | None]) -> Any:
    """The settings of a group, of the class that they name; None where they name none."""
    require(isinstance(settings, Mapping), group, settings, "a group of settings")
    cls = class_of(settings)
    own = {key: value for key, value in settings.items() if key not in NAMES_OF_CLASS}
    return None if cls is None else construct(cls, own, group)


def construct(cls: type[T], data: Mapping[str, Any], place: str, **ready: Any) -> T:
    """``cls(**data)`` with nested dataclasses built, and types and values checked; fields in ``ready`` are taken as they are.

    A library would do the same with looser types: OmegaConf and pydantic take 1 for "1" or true for 1, and OmegaConf refuses
    5e5 as a whole number, which is how YAML reads many frames.

    Raises:
        ConfigError: a name, type or value is wrong; the message has the setting's dotted path, which begins with ``place``.
    """
    require(isinstance(data, Mapping), place, data, "a group of settings")
    fields = {f.name: f for f in dataclasses.fields(cls) if f.init}  # type: ignore[arg-type]
    hints = typing.get_type_hints(cls)
    values = dict(ready)
    for name, value in data.items():
        path = path_of(place, name)
        if name not in fields:
            raise ConfigError(
                f"no setting is called '{path}'.{did_you_mean(path, [path_of(place, f) for f in fields])}"
            )
        values[name] = _convert(value, hints[name], path)
    for name, field in fields.items():
        if name not in values and field.default is field.default_factory is dataclasses.MISSING:
            raise ConfigError(f"{path_of(place, name)}: it has no default; give one as {path_of(place, name)}=...")
    for name, value in values.items():
        check_value(value, hints_of(cls)[name], path_of(place, name))
    return cls(**values)


def flat(data: Mapping[str, Any], place: str = "") -> dict[str, Any]:
    """Nested groups of settings as one mapping of dotted names."""
    found: dict[str, Any] = {}
    for key, value in data.items():
        name = path_of(place, key)
        found |= flat(value, name) if isinstance(value, Mapping) else {name: value}
    return found


def _convert(value: Any, hint: Any, path: str) -> Any:
    origin, arguments = typing.get_origin(hint), typing.get_args(hint)
    if origin in (types.UnionType, typing.Union):
        if value is None and type(None) in arguments:
            return None
        words = [word for a in arguments if typing.get_origin(a) is typing.Literal for word in typing.get_args(a)]
        if value in words:
            return value
        (hint,) = (a for a in arguments if a is not type(None) and typing.get_origin(a) is not typing.Literal)
        try:
            return _convert(value, hint, path)
        except ConfigError as error:
            raise ConfigError(f"{error}, or {' or '.join(words)}") if words else error from None
    if dataclasses.is_dataclass(hint) and isinstance(value, Mapping):
        return construct(typing.cast(type, hint), value, path)
    if origin is tuple and isinstance(value, list | tuple):
        return tuple(_convert(v, arguments[0], f"{path}[{i}]") for i, v in enumerate(value))
    if origin is not None and isinstance(origin, type) and issubclass(origin, Mapping) and isinstance(value, Mapping):
        return dict(value)
    if hint is float and _is_number(value):
        return float(value)
    if hint is int and _is_number(value) and float(value).is_integer():
        return int(value)  # YAML reads 5e5 as a float
    if hint in (str, bool) and isinstance(value, hint):
        return value
    if hint is Path and isinstance(value, str):
        return Path(value)
    raise ConfigError(f"{path}: {value!r} is not {_in_words(hint)}")


def _is_number(value: Any) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool)


def _in_words(hint: Any) -> str:
    origin, arguments = typing.get_origin(hint), typing.get_args(hint)
    if origin is tuple:
        return f"a list whose entries are each {_in_words(arguments[0])}"
    if origin in (types.UnionType, typing.Union):
        return ", or ".join(_in_words(one) for one in arguments if one is not type(None))
    if origin is typing.Literal:
        return " or ".join(map(str, arguments))
    names = {int: "a whole number", float: "a number", str: "text", bool: "true or false", Path: "a place"}
    return names.get(hint, "a group of settings")
