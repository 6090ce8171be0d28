"""The modules that the settings of a run name, what these import, and where they lie."""

import ast
import importlib.util
import sys
import sysconfig
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import segar
from segar.experiments.runs.source_text import nodes_of
from segar.experiments.settings import TARGET, name_of_target, path_of
from segar.support import ObjectName, object_name

OURS = "segar"
# In a checkout, the latter two are links to folders beside the first.
OUR_FOLDERS = tuple((Path(segar.__file__).parent / name).resolve() for name in ("", "experiments", "analysis"))
# Where a learner's own code ends: what these rooms do decides no weight.
LEARNING = tuple(f"segar.experiments.{room}" for room in ("algorithms", "collection", "curricula", "networks"))
MODULE_PATH = "module_path"
NO_CODE = ("tracking", "root", "folder", MODULE_PATH)  # settings that name nothing which is imported


def names_in(settings: Any, place: str = "", is_part: bool = False) -> Iterator[tuple[str, ObjectName]]:
    """The Python objects that settings name, as ``module:attribute`` or ``_target_: module.Class``, and where they do."""
    if isinstance(settings, str) and (found := object_name(settings)):
        yield place, found
    is_group = isinstance(settings, Mapping)
    for key, part in (
        settings.items() if is_group else enumerate(settings) if isinstance(settings, list | tuple) else ()
    ):
        if is_part or key not in NO_CODE:
            yield from names_in(part, path_of(place, key), is_part or is_group)
            if key == TARGET and isinstance(part, str):
                yield from names_in(name_of_target(part), path_of(place, key))


def modules_named(settings: Any) -> Iterator[str]:
    """The modules of the objects that settings name."""
    return (name.module for _, name in names_in(settings))


def own_packages(settings: Any) -> set[str]:
    """The packages, or modules in no package, that settings name and that are not ours."""
    return {name.partition(".")[0] for name in modules_named(settings)} - {OURS}


def is_own(package: str) -> bool:
    """Whether an import would find a package in a folder of the user's, or nowhere: not in Python, the installed or ours."""
    spec = segar.__spec__ if package == "__main__" else importlib.util.find_spec(package)
    places = (spec.origin, *(spec.submodule_search_locations or ())) if spec else ()
    found = [Path(place).resolve() for place in places if place]
    return all(one.exists() and not is_library(one) for one in found)


def folders_of(settings: Any) -> tuple[str, ...]:
    """The folders from which the modules that settings name are imported, without those of installed packages and our own."""
    found = (importlib.util.find_spec(name) for name in sorted(own_packages(settings)))
    files = [Path(spec.origin).resolve() for spec in found if spec is not None and spec.origin is not None]
    outside = (path for path in files if not is_installed(path))
    folders = (path.parents[1] if path.name == "__init__.py" else path.parent for path in outside)
    return tuple(dict.fromkeys(map(str, folders)))


def where_searched(error: BaseException | None, module_path: Sequence[str]) -> str:
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
    """The file that a name of :mod:`segar.experiments.runs.own_files` means now; None where there is none.

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
    if spec is None:
        return None
    # Of a dotted name, importlib.util.find_spec would import what stands before the last dot.
    places = [Path(place, *rest) for place in (spec.submodule_search_locations or ())] if rest else []
    files = [file for place in places for file in (place / "__init__.py", place.with_name(f"{place.name}.py"))]
    origin = [Path(spec.origin)] if spec.origin and not rest else []
    return next((file for file in (*files, *origin) if file.suffix == ".py" and file.is_file()), None)


def is_installed(path: Path) -> bool:
    """Whether a file belongs to Python or to a package that was installed, rather than to a checkout or a folder of scripts."""
    folders = (sysconfig.get_path(kind) for kind in ("stdlib", "platstdlib", "purelib", "platlib"))
    return any(path.is_relative_to(folder) for folder in folders) or "site-packages" in path.parts


def is_library(path: Path) -> bool:
    """Whether a file belongs to Python, to a package that was installed, or to SEGAR."""
    return is_installed(path) or any(map(path.is_relative_to, OUR_FOLDERS))


def modules_reached(module: str) -> dict[str, Path]:
    """Name and file of ``module`` and of what it imports of its own package, of ``segar``, and of code that is not installed,
    such as modules that lie beside it; nothing is imported here.

    Of ``segar``, only what learns counts, and where ``module`` is one of it, the room in which that lies.
    """
    found: dict[str, Path] = {}
    waiting, (room, _, _) = [module], module.rpartition(".")
    rooms = (*LEARNING, room) if room.startswith(OURS) else LEARNING
    while waiting:
        name = waiting.pop()
        path = None if name in found else source_reached(name, module.partition(".")[0], rooms)
        if path is not None:
            found[name] = path
            waiting += imported_by(name, path)
    return found


def source_reached(module: str, package: str, rooms: tuple[str, ...] = LEARNING) -> Path | None:
    """The file of a module that a module of ``package`` imports; None where it does not count: see :func:`modules_reached`."""
    top = module.partition(".")[0]
    if top in sys.stdlib_module_names or (top == OURS and not module.startswith(rooms)):
        return None
    path = source_of(module)
    return None if path is None or (top not in (package, OURS) and is_installed(path)) else path


def imported_by(module: str, path: Path) -> Iterator[str]:
    """Absolute names of what a module imports, at its top or within; of ``from a import b`` both ``a`` and ``a.b``."""
    package = module if path.name == "__init__.py" else module.rpartition(".")[0]
    for node in nodes_of(path):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            above = ".".join(package.split(".")[: len(package.split(".")) + 1 - node.level]) if node.level else ""
            source = ".".join(part for part in (above, node.module) if part)
            yield from (source, *(f"{source}.{alias.name}" for alias in node.names))
