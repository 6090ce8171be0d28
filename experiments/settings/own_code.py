"""Users' own objects in settings: ``module:attribute``, ``folder/file.py:attribute``, and level files.

Settings are kept without places: a file's object becomes ``module:attribute``, with the folder among ``module_path``, and a
level file's name gets its content's fingerprint behind it, ``folder/levels.npz#3f9a12cd``. So a run's name does not hang on
where things lie, and an edited level file is another one.
"""

import importlib
import re
import sys
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any, TypeVar

from segar.errors import naming
from segar.experiments.settings.checks import path_of
from segar.experiments.settings.errors import ConfigError
from segar.support import module_in_file, named_object, object_name, resolve, sha256_of

SHOWN = 6  # members that an error lists, at most
LEVEL_FILE = re.compile(r"(.+\.(?:npz|json))(?:#([0-9a-f]{8}))?")


T = TypeVar("T")


def without_files(settings: Any, place: str = "", folder: Path | None = None) -> Any:
    """Settings (plain data) in which own objects are named by modules, and level files with what is in them.

    Args:
        place: the dotted path of these settings, for errors.
        folder: where relative paths begin; None: the working directory.

    Raises:
        ConfigError: a file that is named does not exist, or cannot be imported as a module.
    """
    if isinstance(settings, Mapping):
        return {key: without_files(value, path_of(place, key), folder) for key, value in settings.items()}
    if isinstance(settings, list | tuple):
        return [without_files(one, place, folder) for one in settings]
    if not isinstance(settings, str):
        return settings
    if (own := object_name(settings)) and own.is_in_file:
        with naming(place, ConfigError):
            return f"{module_in_file((folder or Path()) / Path(own.module).expanduser())}:{own.attribute}"
    if (found := LEVEL_FILE.fullmatch(settings)) and found[2] is None:
        path = ((folder or Path()) / Path(found[1]).expanduser()).resolve()
        return f"{path}#{file_fingerprint(path, place)}"
    return settings


def is_level_file(name: str) -> bool:
    """Whether ``name`` is that of a level file, in npz or JSON, with or without the fingerprint of what is in it."""
    return LEVEL_FILE.fullmatch(name) is not None


def level_file(name: str, place: str) -> Path | None:
    """The level file that ``folder/levels.npz#3f9a12cd`` names; None where ``name`` is of another form.

    Raises:
        ConfigError: there is no such file, or other levels are in it than when it was named.
    """
    found = LEVEL_FILE.fullmatch(name)
    if found is None:
        return None
    path = Path(found[1]).expanduser()
    if found[2] is not None and file_fingerprint(path, place) != found[2]:
        raise ConfigError(f"{place}: {path} holds other levels than when it was named, with #{found[2]}; name it anew")
    return path


def without_folder(name: str) -> str:
    """The name of a level file without its folder; any other name as it is."""
    return name.rpartition("/")[2] if is_level_file(name) else name


def file_fingerprint(path: Path, place: str) -> str:
    """Eight hexadecimal digits of a file's content; raises :class:`ConfigError` if it cannot be read."""
    with naming(place, ConfigError):
        return sha256_of(path, "level file", ConfigError)[:8]


def add_module_path(folders: Iterable[str]) -> None:
    """Has modules looked for in these folders, too, after all other places."""
    new = [folder for folder in folders if folder not in sys.path and Path(folder).is_dir()]
    sys.path += new
    if new:
        importlib.invalidate_caches()


def import_object(name: str, place: str, what: str = "", known: Mapping[str, Any] | None = None) -> Any:
    """What the registry ``known``, of things that are each a ``what``, has of a name, else the object that
    ``module:attribute`` names; raises :class:`ConfigError` that names ``place``."""
    with naming(place, ConfigError):
        return named_object(name) if known is None else resolve(name, known, what)


def name_of_target(target: str) -> str:
    """An import path, ``module.Class``, as ``module:Class``."""
    return ":".join(target.rpartition(".")[::2])


def class_named(target: str, base: type[T], place: str) -> type[T]:
    """The sub-class of ``base`` that an import path, ``module.Class``, names; raises :class:`ConfigError`."""
    cls = import_object(name_of_target(target), place)
    if not (isinstance(cls, type) and issubclass(cls, base)):
        raise ConfigError(f"{place}: '{target}' is not a sub-class of segar.experiments.settings.{base.__name__}")
    return cls


def class_behind(config: Any, setting: str, protocol: type, place: str) -> Any:
    """The class that carries settings out, which their class variable ``setting`` names; raises :class:`ConfigError` that lists
    the methods of ``protocol`` which it lacks."""
    name, noun = getattr(config, setting, None), protocol.__name__.lower()
    if not isinstance(name, str):
        raise ConfigError(
            f"{place}: {type(config).__module__}.{type(config).__qualname__} names no {noun};"
            f" {setting}: ClassVar[str] = 'module:Class' does"
        )
    found = import_object(name, place)
    require_members(found, vars(protocol), f"{place}: {name} is no {noun}", protocol)
    return found


def require_members(found: Any, members: Iterable[str], problem: str, protocol: type) -> None:
    """Raise :class:`ConfigError` that begins with the ``problem`` where an object lacks some of these public members."""
    if lacking := [name for name in members if not name.startswith("_") and not hasattr(found, name)]:
        shown = ", ".join(lacking[:SHOWN]) + (", ..." if len(lacking) > SHOWN else "")
        raise ConfigError(f"{problem}: it lacks {shown}. {protocol.__module__} says what each is for")
