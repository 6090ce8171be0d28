"""Python objects by their names, as ``module:attribute`` on a command line, in a configuration or in levels; and packages that
are installed only on request, those of the extras in pyproject.toml."""

import importlib
import importlib.util
import os
from typing import Any

from segar.errors import SegarError, did_you_mean


def named_object(name: str) -> Any:
    """The object that ``module:attribute`` names; the attribute may have dots.

    Raises:
        SegarError: the name has another form, the module cannot be imported, or it has no such attribute.
    """
    module, _, attribute = name.partition(":")
    if not module or not attribute:
        raise SegarError(f"'{name}' does not name a Python object; write module:attribute")
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
