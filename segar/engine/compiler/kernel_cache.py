"""Generated modules as files: named by the hash of their content, compiled by numba once per machine.

The hash covers the whole text, geometry included, and numba's version, so an edited rule can never run stale. Kernels that
somebody else made ready are read where they are trusted; new ones are kept in the user's own folder.
"""

import hashlib
import sys
import time
from pathlib import Path
from types import ModuleType

from segar.support import (
    ADVICE,
    MACHINE_CODE,
    cache_folder,
    is_trusted,
    keep_kernel,
    private_cache_folder,
    replacing,
    say_where_kept,
)

YARDSTICK, REPEATS = 850, 5  # numba takes so many times as long as Python's own compiler: 650 to 1,250 in six worlds

_loaded: dict[str, ModuleType] = {}


def kernel_path(text: str) -> Path:
    """The file of the module with this source, whether it is there yet or not."""
    import numba

    name = hashlib.sha256(f"{numba.__version__}\n{text}".encode()).hexdigest()[:16]
    return cache_folder() / f"k_{name}.py"


def load_module(text: str) -> ModuleType:
    """Import the module with this source, writing it to the user's folder first where it is not there yet.

    Raises:
        SegarError: no folder can be written, or others could write to it; see :func:`segar.support.private_cache_folder`.
    """
    path = kernel_path(text)
    name = path.stem
    if name in _loaded:
        return _loaded[name]
    own = private_cache_folder()
    if not (is_trusted(path.parent) and _holds(path, text)):
        path = own / path.name
        # Numba's index is keyed by the file's content, so only what was damaged or edited is written again.
        if not _holds(path, text):
            say_where_kept(own)
            with replacing(path, "the kernel", advice=ADVICE) as beside:
                beside.write_text(text, encoding="utf-8")
    module = ModuleType(name)
    module.__file__ = str(path)
    sys.modules[name] = module  # numba's cached code finds its globals by this name
    # Not by the loader, whose file of bytecode may be damaged; and numba's own cache asks for more than can be read.
    exec(compile(text.replace(", cache=True", ""), path, "exec", dont_inherit=True), vars(module))
    if hasattr(module, "advance"):
        if not is_compiled(path):
            expected = f"first time, about {expected_seconds(text):.0f} s"
            print(f"segar: compiling kernel {name[2:6]} ({expected})", file=sys.stderr, flush=True)
        keep_kernel(module.advance)
    else:  # what kernels share: each function is kept by itself
        for function in vars(module).values():
            if hasattr(function, "py_func"):
                keep_kernel(function)
    _loaded[name] = module
    return module


def expected_seconds(text: str) -> float:
    """How long the compilation of a kernel with this source takes, as fast and as busy as this machine is now [s]."""
    began = time.perf_counter()
    for _ in range(REPEATS):
        compile(text, "yardstick", "exec", dont_inherit=True)
    return YARDSTICK * (time.perf_counter() - began) / REPEATS


def is_compiled(path: Path) -> bool:
    """Whether numba's cache holds the machine code of the module's entry point, and not only the index of it."""
    return all(any((path.parent / MACHINE_CODE).glob(f"{path.stem}.advance-*.{ending}")) for ending in ("nbi", "nbc"))


def _holds(path: Path, text: str) -> bool:
    try:
        return path.read_text(encoding="utf-8") == text
    except (OSError, UnicodeDecodeError):  # what is not there, or cannot be read, is written
        return False
