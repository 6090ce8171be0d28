"""Compiled functions that are kept on disk, as numba keeps them, with a checksum on every file.

Numba reads its files as pickles and trusts them: a damaged one ends every later program. Here it is compiled again.
"""

import hashlib
import io
import os
import shutil
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from numba import njit
from numba.core.caching import CompileResultCacheImpl, FunctionCache, IndexDataCacheFile, InTreeCacheLocator

from segar.errors import SegarError
from segar.support.code_folder import MACHINE_CODE, cache_folder, is_trusted, private_cache_folder, say_where_kept
from segar.support.files import replacing

# Environment variable: seconds of steps as Python; with 0 the first step waits for machine code.
PATIENCE = "SEGAR_PATIENCE"
SECONDS = 0.5  # where the variable is not set
PART = 0.2  # of that: what a function may take
MOST_NUMBERS = 200_000  # in the arrays of a call as Python
CHECKED = "-checked"  # ends the names of files with a checksum, so that files without one are left alone
CHECKSUM_LENGTH = 32  # bytes of SHA-256
ADVICE = "make room or give access"


def patience() -> float:
    """How long steps of a new world may take as Python before it is compiled [s].

    Raises:
        SegarError: the environment variable :data:`PATIENCE` is not a number.
    """
    said = os.environ.get(PATIENCE)
    try:
        return SECONDS if said is None else float(said)
    except ValueError:
        raise SegarError(f"{PATIENCE}: '{said}' is no number of seconds") from None


def cached(patient: bool = False, **options: Any) -> Callable[[Callable[..., Any]], Any]:
    """A decorator: numba's ``njit`` with these options, whose machine code is kept on disk and checked when it is read.

    Args:
        patient: calls on small arrays are plain Python until they have taken some time, as steps of a new world are.
    """

    def decorate(function: Callable[..., Any]) -> Any:
        compiled: Any = njit(**options)(function)
        compiled._cache = CheckedCache(function, of_package=True)
        if patient:
            compiled._compile_for_args = _Patient(compiled)
        return compiled

    return decorate


class _Patient:
    """What numba calls for a function that it finds not compiled; it then calls what this returns."""

    def __init__(self, compiled: Any) -> None:
        self._compile, self._function = compiled._compile_for_args, compiled.py_func
        self._files: _CheckedFiles = compiled._cache._cache_file
        self._seconds = 0.0  # that it took as Python

    def __call__(self, *arguments: Any) -> Any:
        numbers = sum(one.size for one in arguments if isinstance(one, np.ndarray))
        is_due = self._seconds >= PART * patience() or numbers > MOST_NUMBERS or self._files.is_there()
        return self._compile(*arguments) if is_due else self._as_python

    def _as_python(self, *arguments: Any) -> Any:
        began = time.thread_time()
        with np.errstate(all="ignore"):
            found = self._function(*arguments)
        self._seconds += time.thread_time() - began
        return found


def keep_kernel(compiled: Any) -> None:
    """Keep the machine code of a function in a kernel's file on disk."""
    compiled._cache = CheckedCache(compiled.py_func)


class _Locator(InTreeCacheLocator):
    """The user's own folder, for the files of all functions."""

    def __init__(self, function: Any, file: str) -> None:
        super().__init__(function, file)
        self._cache_path = str(private_cache_folder() / MACHINE_CODE)

    @classmethod
    def from_function(cls, py_func: Any, py_file: str) -> "_Locator":
        return cls(py_func, py_file)

    def get_source_stamp(self) -> bytes:
        """A hash of the source, as numba 0.68 takes it; older ones take the time, which says another thing after a checkout."""
        return _source_hash(self._py_file, os.stat(self._py_file).st_mtime_ns)


@cache
def _source_hash(path: str, changed: int) -> bytes:
    return hashlib.sha256(Path(path).read_bytes()).digest()


class _Kept(CompileResultCacheImpl):
    _locator_classes = [_Locator]  # noqa: RUF012 - numba's attribute


class CheckedCache(FunctionCache):
    """Numba's cache of one function, in files with checksums.

    Args:
        of_package: the function is one of a package, of which several versions may be installed; a kernel's file has a name
            of its own.
    """

    _impl_class = _Kept

    def __init__(self, function: Callable[..., Any], of_package: bool = False) -> None:
        super().__init__(function)
        name, stamp = self._impl.filename_base + CHECKED, self._impl.locator.get_source_stamp()
        if of_package:
            name = f"{stamp.hex()[:16]}.{name}"
        self._cache_file = _CheckedFiles(self._cache_path, name, stamp)
        ready = cache_folder() / MACHINE_CODE
        if str(ready) != self._cache_path and is_trusted(ready.parent):
            self._cache_file.ready = _CheckedFiles(str(ready), name, stamp)

    def _load_overload(self, sig: Any, target_context: Any) -> Any:
        try:
            return super()._load_overload(sig, target_context)
        except SegarError:
            raise
        except Exception:  # it is whole, and yet this version of the libraries cannot use it
            self._cache_file.discard_all()
            return None

    def _save_overload(self, sig: Any, data: Any) -> None:
        say_where_kept(Path(self.cache_path).parent)
        try:
            super()._save_overload(sig, data)
        except OSError as cause:
            raise SegarError(
                f"machine code cannot be written to {self.cache_path}: {cause.strerror or cause}; {ADVICE}"
            ) from cause


class _CheckedFiles(IndexDataCacheFile):
    """Numba's two kinds of files, each with a checksum of its name and content at its end, which pickles do not read."""

    _cache_path: str
    _index_path: str
    ready: "_CheckedFiles | None" = None  # where somebody else may have put the same files

    def is_there(self) -> bool:
        """Whether there is machine code, for whatever types, here or where somebody else made it."""
        return Path(self._index_path).exists() or (self.ready is not None and self.ready.is_there())

    def load(self, key: Any) -> Any:
        """What is kept, or what somebody else made ready."""
        found = super().load(key)
        return self.ready.load(key) if found is None and self.ready else found

    def discard_all(self) -> None:
        """Remove the index and all data of the function."""
        _discard(Path(self._index_path))
        for path in Path(self._cache_path).glob(self._data_name_pattern.format(number=0).replace(".0.nbc", ".*.nbc")):
            _discard(path)

    def _load_index(self) -> Any:
        found = self._checked(Path(self._index_path), super()._load_index)
        return {} if found is None else found

    def _load_data(self, name: str) -> Any:
        load = super()._load_data
        return self._checked(Path(self._data_path(name)), lambda: load(name))

    def _checked(self, path: Path, load: Callable[[], Any]) -> Any:
        """What numba loads from a file; None, and the file is removed, where it is not as it was written."""
        try:
            content = path.read_bytes()
            if content[-CHECKSUM_LENGTH:] == _checksum(path, content[:-CHECKSUM_LENGTH]):
                return load()
        except FileNotFoundError:
            return None
        except Exception:  # no permission, a folder in its place, or a pickle of what is no more
            pass
        _discard(path)
        return None

    @contextmanager
    def _open_for_write(self, filepath: str) -> Iterator[Any]:
        path, content = Path(filepath), io.BytesIO()
        yield content
        with replacing(path, "machine code", advice=ADVICE) as beside:
            beside.write_bytes(content.getvalue() + _checksum(path, content.getvalue()))


def _checksum(path: Path, content: bytes) -> bytes:
    return hashlib.sha256(path.name.encode() + content).digest()


def _discard(path: Path) -> None:
    """Remove a file that cannot be used, so that the next one takes its place; what can only be read is left."""
    _say_once(path.parent)
    if not os.access(path.parent, os.W_OK):
        return
    try:
        if path.is_dir() and not path.is_symlink():
            shutil.rmtree(path)
        else:
            path.unlink(missing_ok=True)
    except OSError as cause:
        raise SegarError(
            f"{path} holds damaged machine code and cannot be removed: {cause.strerror}; remove it"
        ) from cause


@cache
def _say_once(folder: Path) -> None:
    print(f"segar: machine code in {folder} is damaged; it is compiled again", file=sys.stderr, flush=True)
