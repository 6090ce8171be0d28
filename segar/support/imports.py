"""Python objects by their names, as ``module:attribute`` on a command line, in a configuration or in levels; and packages that
are installed only on request, those of the extras in pyproject.toml."""

import importlib
import importlib.util
import os
import sys
from importlib.machinery import PathFinder
from pathlib import Path
from typing import Any

from segar.errors import SegarError, did_you_mean


def named_object(name: str) -> Any:
    """The object that ``module:attribute`` or ``folder/file.py:attribute`` names; the attribute may have dots.

    Raises:
        SegarError: the name has another form, the module cannot be imported, or it has no such attribute.
    """
    module, _, attribute = name.rpartition(":")
    if not module or not attribute:
        raise SegarError(f"'{name}' does not name a Python object; write module:attribute, or file.py:attribute")
    if module.endswith(".py"):
        module = module_in_file(Path(module))
    try:
        found: Any = importlib.import_module(module)
    except (ImportError, SegarError) as error:
        raise SegarError(f"'{name}' cannot be imported: {error}") from error
    for part in attribute.split("."):
        if not hasattr(found, part):
            public = [name for name in vars(found) if not name.startswith("_")]
            raise SegarError(f"'{module}' has no '{part}'.{did_you_mean(part, public)}")
        found = getattr(found, part)
    return found


def module_in_file(file: Path) -> str:
    """The name under which a Python file can be imported from now on; its folder is added at the end of ``sys.path``.

    A file of a package is a module of that package, and the folder that holds the package is added.

    Raises:
        SegarError: there is no such file, or its name is that of another module.
    """
    path = file.expanduser().resolve()
    if not path.is_file():
        raise SegarError(f"there is no file {path}")
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


EXTRAS = {
    "render": ("pygame", "imageio", "imageio_ffmpeg", "PIL"),
    "datasets": ("minari", "h5py", "pyarrow"),
    "filters": ("safetensors",),
}


def need(purpose: str, *modules: str) -> None:
    """Raise :class:`SegarError`, which names the extra to install, unless these modules are there for ``purpose``."""
    for module in modules:
        if importlib.util.find_spec(module) is None:
            extra = next(extra for extra, brought in EXTRAS.items() if module in brought)
            raise SegarError(f"{purpose} needs {module}, which is not installed: pip install 'segar[{extra}]'")


def need_pygame(purpose: str) -> None:
    """:func:`need` pygame, and have it say nothing when it is loaded."""
    need(purpose, "pygame")
    os.environ.setdefault("PYGAME_HIDE_SUPPORT_PROMPT", "1")
