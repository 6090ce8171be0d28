"""Generated modules as files: named by the hash of their content, compiled by numba once per machine.

The hash covers the whole text, geometry included, and numba's version, so an edited rule can never run stale. What numba keeps
of them are pickles, which run code when they are read. The folder therefore belongs to the user alone.
"""

import errno
import hashlib
import importlib.util
import os
import pwd
import shutil
import stat
import sys
from pathlib import Path
from types import ModuleType

from segar.errors import SegarError
from segar.support import keep_beside, replacing

FOLDER = "SEGAR_CACHE_DIR"  # the variable that names the folder
MACHINE_CODE = "__pycache__"  # where numba keeps it, beside the kernels
COMPILED = f"{MACHINE_CODE}/*.advance-*.nbi"
OWN, OTHERS_WRITE = 0o700, stat.S_IWGRP | stat.S_IWOTH
_loaded: dict[str, ModuleType] = {}


def cache_folder() -> Path:
    """Where generated kernels lie: ``$SEGAR_CACHE_DIR``, else the user's cache folder; an empty name counts as none."""
    if os.environ.get(FOLDER):
        return Path(os.environ[FOLDER])
    base = os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache"
    return Path(base) / "segar" / "kernels"


def private_cache_folder() -> Path:
    """:func:`cache_folder`, made if need be, to which nobody but the user can write.

    The default folder is mended where others could write to it, and the machine code in it is thrown away.

    Raises:
        SegarError: the folder belongs to somebody else, others can write to the folder that ``$SEGAR_CACHE_DIR`` names, or it
            cannot be made.
    """
    folder = cache_folder()
    compiled = folder / MACHINE_CODE
    try:
        for path in (folder, compiled):
            path.mkdir(parents=True, exist_ok=True, mode=OWN)
            if path.stat().st_uid != os.geteuid():
                raise SegarError(
                    f"{path} belongs to {_user(path.stat().st_uid)}, whose kernels would run as you; set {FOLDER} to a"
                    " folder of your own"
                )
        if _others_write(folder) and os.environ.get(FOLDER):
            raise SegarError(
                f"others can write to {folder}, and their kernels would run as you: chmod go-w {folder}, or set {FOLDER} to"
                " a folder of your own"
            )
        if _others_write(folder) or _others_write(compiled):
            folder.chmod(stat.S_IMODE(folder.stat().st_mode) & ~OTHERS_WRITE)
            shutil.rmtree(compiled)
            compiled.mkdir(mode=OWN)
        compiled.chmod(OWN)
        if not os.access(folder, os.W_OK) or not os.access(compiled, os.W_OK):
            raise PermissionError(errno.EACCES, os.strerror(errno.EACCES))
    except OSError as cause:
        raise SegarError(
            f"kernels cannot be kept in {folder}: {cause.strerror}; set {FOLDER} to a folder that can be written"
        ) from cause
    return folder


def _others_write(path: Path) -> bool:
    return bool(path.stat().st_mode & OTHERS_WRITE)


def _user(number: int) -> str:
    try:
        return pwd.getpwuid(number).pw_name
    except KeyError:
        return f"user {number}"


def kernel_path(text: str) -> Path:
    """The file of the module with this source, whether it is there yet or not."""
    import numba

    name = hashlib.sha256(f"{numba.__version__}\n{text}".encode()).hexdigest()[:16]
    return cache_folder() / f"k_{name}.py"


def load_module(text: str) -> ModuleType:
    """Import the module with this source, writing it to the cache first where it is not there yet.

    Raises:
        SegarError: the cache folder cannot be written, or others could write to it; see :func:`private_cache_folder`.
    """
    path = kernel_path(text)
    name = path.stem
    if name in _loaded:
        return _loaded[name]
    private_cache_folder()
    # Numba's index is keyed by the file's time of change, so only what was damaged or edited is written again.
    if not _holds(path, text):
        advice = f"set {FOLDER} to a folder that can be written"
        with replacing(path, "the kernel", advice=advice) as beside:
            beside.write_text(text)
    spec = importlib.util.spec_from_file_location(name, path)
    assert spec is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules[name] = module  # numba's cached code finds its globals by this name
    exec(
        compile(text, path, "exec", dont_inherit=True), vars(module)
    )  # not the loader, whose file of bytecode may be damaged
    if hasattr(module, "advance"):
        if not is_compiled(path):
            print(f"segar: compiling kernel {name[2:6]} (first time, {usual_time()})", file=sys.stderr, flush=True)
        keep_beside(module.advance)
    else:  # what kernels share: each function is kept by itself
        for function in vars(module).values():
            if hasattr(function, "py_func"):
                keep_beside(function)
    _loaded[name] = module
    return module


def usual_time() -> str:
    """How long compiling takes, in words: the median of the kernels in the folder, by the times of their two files."""
    kernels = {path: cache_folder() / f"{path.name.partition('.')[0]}.py" for path in cache_folder().glob(COMPILED)}
    took = sorted(path.stat().st_mtime - text.stat().st_mtime for path, text in kernels.items() if text.exists())
    return f"about {took[len(took) // 2]:.0f} s, as others here" if took else "some 10 s or more"


def is_compiled(path: Path) -> bool:
    """Whether numba's cache holds the machine code of the module's entry point."""
    return any((path.parent / MACHINE_CODE).glob(f"{path.stem}.advance-*.nbi"))


def _holds(path: Path, text: str) -> bool:
    try:
        return path.read_text() == text
    except (OSError, UnicodeDecodeError):  # what is not there, or cannot be read, is written
        return False
