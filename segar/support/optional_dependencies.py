"""What is installed only on request: packages of the extras in pyproject.toml."""

import importlib.util
import os

from segar.errors import SegarError

EXTRAS = {
    "pygame": "render",
    "imageio": "render",
    "imageio_ffmpeg": "render",
    "PIL": "render",
    "minari": "datasets",
    "h5py": "datasets",
    "pyarrow": "datasets",
    "safetensors": "filters",
}


def need(purpose: str, *modules: str) -> None:
    """Raise :class:`SegarError`, which names the extra to install, unless these modules are there for ``purpose``."""
    for module in modules:
        if importlib.util.find_spec(module) is None:
            extra = f"segar[{EXTRAS[module]}]"
            raise SegarError(f"{purpose} needs {module}, which is not installed: pip install '{extra}'")


def need_pygame(purpose: str) -> None:
    """:func:`need` pygame, and have it say nothing when it is loaded."""
    need(purpose, "pygame")
    os.environ.setdefault("PYGAME_HIDE_SUPPORT_PROMPT", "1")
