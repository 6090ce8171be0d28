"""Generated modules as files: named by the hash of their content, compiled by numba once per machine.

The hash covers the whole text, geometry included, and numba's version, so an edited rule can never run stale.
"""

import hashlib
import importlib.util
import os
import sys
from pathlib import Path
from types import ModuleType

from segar.support import replacing

_loaded: dict[str, ModuleType] = {}


def cache_folder() -> Path:
    """Where generated kernels lie: ``$SEGAR_CACHE_DIR``, else the user's cache folder."""
    if "SEGAR_CACHE_DIR" in os.environ:
        return Path(os.environ["SEGAR_CACHE_DIR"])
    base = os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache"
    return Path(base) / "segar" / "kernels"


def kernel_path(text: str) -> Path:
    """The file of the module with this source, whether it is there yet or not."""
    import numba

    name = hashlib.sha256(f"{numba.__version__}\n{text}".encode()).hexdigest()[:16]
    return cache_folder() / f"k_{name}.py"


def load_module(text: str) -> ModuleType:
    """Import the module with this source, writing it to the cache first where it is not there yet.

    Raises:
        SegarError: the cache folder cannot be written.
    """
    path = kernel_path(text)
    name = path.stem
    if name in _loaded:
        return _loaded[name]
    # Numba's index is keyed by the file's time of change, so only what was damaged or edited is written again.
    if not _holds(path, text):
        advice = "set SEGAR_CACHE_DIR to a folder that can be written"
        with replacing(path, "the kernel", advice=advice, folder=True) as beside:
            beside.write_text(text)
    if not is_compiled(path):
        print(f"segar: compiling kernel {name[2:6]} (first time, about 10 s)", file=sys.stderr, flush=True)
    spec = importlib.util.spec_from_file_location(name, path)
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules[name] = module  # numba's cached code finds its globals by this name
    spec.loader.exec_module(module)
    _loaded[name] = module
    return module


def is_compiled(path: Path) -> bool:
    """Whether numba's cache holds the machine code of the module's entry point."""
    folder = Path(os.environ["NUMBA_CACHE_DIR"]) if "NUMBA_CACHE_DIR" in os.environ else path.parent
    return any(folder.rglob(f"{path.stem}.advance-*.nbi"))


def _holds(path: Path, text: str) -> bool:
    try:
        return path.read_text() == text
    except (OSError, UnicodeDecodeError):  # what is not there, or cannot be read, is written
        return False
