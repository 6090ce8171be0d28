"""The modules that the settings of a run name, and where they lie."""

import importlib.util
import sys
from collections.abc import Iterator, Mapping, Sequence
from importlib.machinery import PathFinder
from pathlib import Path
from typing import Any

from experiments.settings import OBJECT_NAME, TARGET
from experiments.settings.files_read import OURS, is_installed

NO_CODE = ("tracking", "root", "folder", "module_path")  # settings that name nothing which is imported


def modules_named(settings: Any) -> Iterator[str]:
    """The modules that settings name as ``module:attribute``, or as ``_target_: module.Class``."""
    if isinstance(settings, Mapping):
        for key, part in settings.items():
            if key == TARGET and isinstance(part, str):
                yield part.rpartition(".")[0]
            elif key not in NO_CODE:
                yield from modules_named(part)
    elif isinstance(settings, list | tuple):
        for part in settings:
            yield from modules_named(part)
    elif isinstance(settings, str) and (found := OBJECT_NAME.fullmatch(settings)):
        yield found[1]


def own_packages(settings: Any) -> set[str]:
    """The packages, or modules in no package, that settings name and that are not ours."""
    return {name.partition(".")[0] for name in modules_named(settings)} - {*OURS}


def folders_of(settings: Any) -> tuple[str, ...]:
    """The folders from which the modules that settings name are imported, without those of installed packages and our own."""
    found = (importlib.util.find_spec(name) for name in sorted(own_packages(settings)))
    files = [Path(spec.origin).resolve() for spec in found if spec is not None and spec.origin is not None]
    outside = (path for path in files if not is_installed(path))
    folders = (path.parents[1] if path.name == "__init__.py" else path.parent for path in outside)
    return tuple(dict.fromkeys(map(str, folders)))


def where_searched(error: ImportError, module_path: Sequence[str]) -> str:
    """In which folders a module was looked for in vain, those of ``module_path`` that are gone among them, and what helps.

    Empty where the module was found and something in it went wrong.
    """
    missing = getattr(error, "name", None) if isinstance(error, ModuleNotFoundError) else None
    if not missing:
        return ""
    package, _, _ = missing.rpartition(".")
    if package:
        folders = list(getattr(sys.modules.get(package), "__path__", ()))
    else:
        known = (Path(place).resolve() for place in (*sys.path, *module_path))
        folders = [str(place) for place in dict.fromkeys(known) if not is_installed(place) and place.suffix != ".zip"]
    told = ", ".join(folder if Path(folder).is_dir() else f"{folder} (which is no longer there)" for folder in folders)
    return (
        f". It was looked for in {told}{'' if package else ', and among installed packages'}. A run keeps the names of its"
        f" modules: give the module this name again, or say before the command which folder holds {missing.partition('.')[0]},"
        " PYTHONPATH=FOLDER"
    )


def find_file(name: str) -> Path | None:
    """The file that a name of :mod:`experiments.settings.files_read` means now; None where there is none.

    Looked into are the folder that holds the package which the name begins with, those of Python's path, and the working one.
    """
    if Path(name).is_absolute():
        return Path(name) if Path(name).is_file() else None
    top = name.partition("/")[0]
    spec = importlib.util.find_spec(top) if top.isidentifier() and top != "__main__" else None
    packages = [Path(place).parent for place in (spec.submodule_search_locations or () if spec else ())]
    outside = [Path(place) for place in sys.path if not is_installed(Path(place))]
    return next((folder / name for folder in (*packages, *outside, Path.cwd()) if (folder / name).is_file()), None)


def source_of(module: str) -> Path | None:
    """The file of a module; None where the name is that of something in a module, or a package without code."""
    top, *rest = module.split(".")
    spec = importlib.util.find_spec(top)
    for name in rest:
        if spec is None or spec.submodule_search_locations is None:
            return None
        # Of a dotted name, importlib.util.find_spec would import what stands before the last dot.
        spec = PathFinder.find_spec(f"{spec.name}.{name}", spec.submodule_search_locations)
    origin = None if spec is None else spec.origin
    return Path(origin) if origin is not None and origin.endswith(".py") else None
