"""Python objects by their names, as ``module:attribute`` on a command line, in a configuration or in levels; and packages that
are installed only on request, those of the extras in pyproject.toml."""

import importlib
import importlib.util
import inspect
import os
import sys
import traceback
from collections.abc import Collection, Mapping
from importlib.machinery import PathFinder
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any, NamedTuple

from segar.errors import SegarError, did_you_mean
from segar.support.json_forms import shown

EVERYTHING = "*"
"""Among trusted packages: all of them, as where a user names an object herself."""


class ObjectName(NamedTuple):
    """The name of a Python object: a module, or the path of its file, and an attribute, which may have dots."""

    module: str
    attribute: str

    def __str__(self) -> str:
        return ":".join(self)

    @property
    def is_in_file(self) -> bool:
        """Whether the file is named in place of the module."""
        return self.module.endswith(".py")

    @property
    def package(self) -> str:
        """The package of the module, or the module where it is in none."""
        return self.module.partition(".")[0]

    def is_trusted(self, trusted: Collection[str]) -> bool:
        """Whether the module, or a package that it is in, is among those that are trusted; a file is where everything is."""
        parts = [] if self.is_in_file else self.module.split(".")
        return not {EVERYTHING, *(".".join(parts[: k + 1]) for k in range(len(parts)))}.isdisjoint(trusted)


def object_name(text: str) -> ObjectName | None:
    """What ``module:attribute`` or ``folder/file.py:attribute`` names; None for a text that names no Python object.

    Nothing is imported by a text of which this is None, so checks of texts ask this function.
    """
    found = ObjectName(*text.rpartition(":")[::2])
    parts = found.attribute.split(".") + ([] if found.is_in_file else found.module.split("."))
    return found if all(part.isidentifier() for part in parts) else None


def resolve(name: str, known: Mapping[str, Any], what: str, trusted: Collection[str] = (EVERYTHING,)) -> Any:
    """What a name stands for: what the registry ``known`` has of it, else the Python object that it names.

    Args:
        what: the kind of things in the registry, for messages, as "task".
        trusted: modules and packages whose objects may be named. There are none where the name stands in a file, which
            somebody else may have written: it reaches the registry alone.

    Raises:
        SegarError: there is no such thing, or its module is not trusted; or as :func:`named_object`.
    """
    if name in known:
        return known[name]
    found = object_name(name)
    near = did_you_mean(name, known)
    if found is None and trusted:
        raise SegarError(f"no {what} is called {shown(name)}.{near} One of your own is 'module:attribute'")
    if found is None or not found.is_trusted(trusted):
        raise SegarError(
            f"the {what} {shown(name)} is not built in, and a file imports no code; give it by {what}= or --{what}.{near}"
        )
    return named_object(name)


def named_object(name: str) -> Any:
    """The object that ``module:attribute`` or ``folder/file.py:attribute`` names; the attribute may have dots.

    Raises:
        SegarError: the name has another form, the module cannot be imported (the message says where it went wrong), or it has
            no such attribute of its own.
    """
    named = object_name(name)
    if named is None:
        raise SegarError(f"'{name}' does not name a Python object; write module:attribute, or file.py:attribute")
    module = module_in_file(Path(named.module)) if named.is_in_file else named.module
    try:
        found: Any = importlib.import_module(_same_file(module))
    except Exception as error:  # the module is the user's, and may go wrong in any way
        raise SegarError(f"'{name}' cannot be imported: {_reason(error)}") from error
    for part in named.attribute.split("."):
        if not hasattr(found, part):
            names = [one for one in dir(found) if not one.startswith("_")]
            public = [one for one in names if not inspect.ismodule(inspect.getattr_static(found, one, None))]
            raise SegarError(f"'{module}' has no '{part}'.{did_you_mean(part, public)}")
        found = getattr(found, part)
        _require_own(name, module.partition(".")[0], found)
    return found


def _require_own(name: str, package: str, found: Any) -> None:
    """Raise :class:`SegarError` for a module of another package, and for what is Python's: whoever trusts a package does not
    trust what it imports."""
    is_module = inspect.ismodule(found)
    home = found.__name__ if is_module else str(getattr(found, "__module__", package))
    top, there = home.partition(".")[0], getattr(sys.modules.get(home), getattr(found, "__name__", ""), None)
    if top != package and (is_module or (top in sys.stdlib_module_names and there is found)):
        raise SegarError(f"'{name}' leads into {home}, which {package} only imports; name what is of {package} itself")


def module_in_file(file: Path) -> str:
    """The name under which a Python file can be imported from now on; its folder is added at the end of ``sys.path``.

    A file of a package is a module of that package, and the folder that holds the package is added.

    Raises:
        SegarError: there is no such file, or its name is that of another module.
    """
    path = file.expanduser().resolve()
    if not path.is_file():
        raise SegarError(f"there is no file {path}")
    if (known := _module_of(path)) is not None:
        return known
    parts, folder = ([] if path.stem == "__init__" else [path.stem]), path.parent
    while (folder / "__init__.py").exists():
        parts, folder = [folder.name, *parts], folder.parent
    name = ".".join(parts)
    if not all(part.isidentifier() for part in parts):
        raise SegarError(f"{path} cannot be imported: '{name}' is no name of a module; rename the file")
    if str(folder) not in sys.path:
        sys.path.append(str(folder))
        importlib.invalidate_caches()
    spec = PathFinder.find_spec(parts[0])
    found = None if spec is None or spec.origin is None else Path(spec.origin).resolve()
    wanted = folder / parts[0] / "__init__.py" if len(parts) > 1 or path.name == "__init__.py" else path
    if found != wanted or parts[0] in sys.stdlib_module_names:
        raise SegarError(f"{path} cannot be imported: Python has another module '{parts[0]}', {found}; rename the file")
    return name


def _module_of(path: Path) -> str | None:
    """The name of the module that was imported from a file; None where none was."""
    for name, module in list(sys.modules.items()):
        origin = getattr(module, "__file__", None)
        if name != "__main__" and origin and os.path.basename(origin) == path.name and Path(origin).resolve() == path:
            return name
    return None


def _same_file(module: str) -> str:
    """The name of a module, or the one under which the same file was imported before: a file is imported once."""
    if module in sys.modules:
        return module
    spec = importlib.util.find_spec(module)
    known = None if spec is None or spec.origin is None else _module_of(Path(spec.origin).resolve())
    return known or module


def named_or_made(name: str) -> Any:
    """The object that ``module:attribute`` names, or what it returns where it is a function.

    Raises:
        SegarError: as :func:`named_object`; the function needs arguments, or goes wrong (the message says where).
    """
    return made(name, named_object(name))


def made(name: str, found: Any, options: Mapping[str, Any] | None = None) -> Any:
    """What a function of this name returns, called with these options; anything else as it is."""
    options = options or {}
    called = f"with {', '.join(map(str, options))}" if options else "without arguments"
    if not inspect.isfunction(found):
        if options:
            raise SegarError(f"'{name}' is called {called}, and is no function, but {found!r}")
        return found
    try:
        inspect.signature(found).bind(**options)
    except TypeError as error:
        raise SegarError(f"'{name}' is called {called}, and {error}; give its arguments defaults") from None
    try:
        return found(**options)
    except Exception as error:  # the function is the user's, and may go wrong in any way
        raise SegarError(f"'{name}' went wrong: {_reason(error)}") from error


def _reason(error: Exception) -> str:
    """What an error says, on one line, and for errors that are not of imports or of SEGAR its kind and where it happened."""
    text = " ".join(str(error).split())
    if isinstance(error, (ImportError, SegarError)):
        return text
    place = traceback.extract_tb(error.__traceback__)[-1]
    return f"{type(error).__name__}: {text} ({os.path.basename(place.filename)}:{place.lineno})"


EXTRAS = {
    "analysis": ("matplotlib",),
    "render": ("pygame", "imageio", "imageio_ffmpeg", "PIL"),
    "datasets": ("minari", "h5py"),
    "filters": ("safetensors",),
    "lab": ("mcp",),
    "onnx": ("onnxruntime",),
    "sb3": ("stable_baselines3",),
    "search": ("optuna",),
    "studio": ("starlette", "uvicorn"),
    "train": ("yaml", "torch", "hydra", "pandas"),
    "ui": ("flask",),
}


def installed_version(package: str) -> str | None:
    """The version of a package; None where it is a checkout on the path, or not installed."""
    try:
        return version(package)
    except PackageNotFoundError:
        return None


def need(purpose: str, *modules: str) -> None:
    """Raise :class:`SegarError`, which names the extra to install, unless these modules are there for ``purpose``."""
    for module in modules:
        if importlib.util.find_spec(module) is None:
            extra = next(extra for extra, brought in EXTRAS.items() if module in brought)
            raise SegarError(f"{purpose} needs {module}, which is not installed: pip install 'segar[{extra}]'")


def has_pygame() -> bool:
    """Whether pygame is installed; it is not imported."""
    return importlib.util.find_spec("pygame") is not None


def need_pygame(purpose: str) -> None:
    """:func:`need` pygame, and have it say nothing when it is loaded."""
    need(purpose, "pygame")
    os.environ.setdefault("PYGAME_HIDE_SUPPORT_PROMPT", "1")
