"""Which files the user's own modules read: a record that the process keeps from the first import of this module on.

Python reports each opening of a file to an audit hook. The record says which files were opened for reading, by which own
modules, with the fingerprint of what was in them. An own module is one that is not installed and none of ours. Python also
opens the source of each module that it loads, or what it compiled of it before. So the record holds the modules that own
modules load by whatever means: ``importlib``, ``runpy``, ``exec`` of a file's text. Files that a library opens without
Python, as pyarrow and h5py do, are not seen.
"""

import hashlib
import importlib.util
import linecache
import os
import sys
import sysconfig
from collections.abc import Collection, Iterable
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from types import FrameType
from typing import Any

import segar
from experiments.settings.source_text import normalised

OURS = ("segar", "experiments", "analysis")
NO_DATA = (".so", ".nbi", ".nbc", ".lock")  # suffixes: compiled code, kernels, locks
SYSTEM = tuple(map(Path, ("/dev", "/etc", "/proc", "/run", "/sys", "/usr", "/var")))
OUR_FOLDERS = (
    Path(segar.__file__).resolve().parent,
    *(Path(__file__).resolve().parents[2] / name for name in OURS if name != "segar"),
)
IMPORT = "<frozen importlib._bootstrap>"  # the file of the frames in which Python imports a module
LOADERS = (IMPORT, "<frozen importlib._bootstrap_external>")  # and of those in which it reads the module's file


@dataclass(frozen=True)
class Reading:
    """A file that own modules read: its name, the source files of the modules, and whether an import read it."""

    path: Path
    name: str
    readers: frozenset[Path]
    at_import: bool


_record: dict[Reading, str] = {}  # with the fingerprint of what was read last


def source_name(module: str, path: Path) -> str:
    """The name of a module's source file from the folder from which it is imported: ``my_lab/levels.py``, ``./levels.py``."""
    parts = (*module.split("."), "__init__") if path.name == "__init__.py" else module.split(".")
    return _with_slash("/".join(parts) + ".py")


def is_source(name: str) -> bool:
    """Whether a name in the record is that of a source file."""
    return name.endswith(".py")


def data_read(readers: Collection[Path]) -> dict[str, str]:
    """The data files that these modules, and those that they loaded, have read, and the source files of the latter, to the
    fingerprints of what was in them.

    A file that lies below the folder that the module is imported from, the working directory, or a folder of Python's path has
    its path from there as its name, another one its absolute path.

    Args:
        readers: the source files of the modules.
    """
    return {one.name: content for one, content in _read_by(readers).items()}


def data_to_read(readers: Collection[Path]) -> dict[str, str]:
    """As :func:`data_read`, for what begins now: what functions read has the content that they will find, and what an import
    read has the content that the module was made from. Files that are gone, which only functions read, are left out."""
    linecache.checkcache()  # which keeps what it has read, also when the file changes
    chosen = _read_by(readers)
    found = {one.name: file_digest(one.path) for one in chosen if not one.at_import and one.path.is_file()}
    return found | {one.name: content for one, content in chosen.items() if one.at_import}


def file_digest(path: Path) -> str:
    """Sixteen hexadecimal digits of a file's content, of a source file's as far as it counts; raises :class:`OSError` if it
    cannot be read."""
    about = path.stat()
    return _digest(path, about.st_mtime_ns, about.st_size)


def is_installed(path: Path) -> bool:
    """Whether a file belongs to Python or to a package that was installed, rather than to a checkout or a folder of scripts."""
    return any(path.is_relative_to(sysconfig.get_path(kind)) for kind in ("stdlib", "platstdlib", "purelib", "platlib"))


def _note(event: str, arguments: tuple[Any, ...]) -> None:
    """The audit hook: adds a file to the record if an own module opens it for reading."""
    if event != "open":
        return
    name, _, flags = arguments
    if not isinstance(name, str | bytes | os.PathLike) or flags & (os.O_WRONLY | os.O_RDWR):
        return
    text = _source_of(os.fsdecode(name))
    if text.endswith(NO_DATA):
        return
    readers, at_import = _own_readers(sys._getframe(1))
    path = Path(os.path.realpath(text)) if readers else Path()
    if not readers or not path.is_file():
        return
    root = _root_of(path, readers.values())
    if not _is_data(path, root):
        return
    known = str(path) if root is None else _with_slash(path.relative_to(root).as_posix())
    try:
        _record[Reading(path, known, frozenset(readers), at_import)] = file_digest(path)
    except OSError:  # the call that opens it meets the same error, and says it to its caller
        return


def _source_of(path: str) -> str:
    """The source file of a module that Python compiled before; any other file as it is."""
    if not path.endswith(".pyc"):
        return path
    try:
        return importlib.util.source_from_cache(path)
    except ValueError:  # compiled by something else, or without its source
        return path


def _read_by(readers: Collection[Path]) -> dict[Reading, str]:
    """What these modules have read, and the modules that they loaded; without themselves."""
    given = {path.resolve() for path in readers}
    chosen = given
    while True:
        found = {one: content for one, content in _record.items() if one.readers <= chosen and one.path not in given}
        more = chosen | {one.path for one in found if is_source(one.name)}
        if more == chosen:
            return found
        chosen = more


def _own_readers(frame: FrameType | None) -> tuple[dict[Path, Path], bool]:
    """The own modules on the stack, innermost first, up to ours or up to an import: the source file of each, and the folder
    from which the module is imported; and whether it was an import.

    Of a module that is being loaded, these are the modules that load it. Source that Python reads through linecache, for the
    text of a traceback or a warning, has no reader; what an own module reads through linecache has.
    """
    found: dict[Path, Path] = {}
    is_import = False
    while frame is not None and frame.f_code.co_filename in LOADERS:
        is_import = is_import or frame.f_code.co_filename == IMPORT
        frame = frame.f_back
    while frame is not None:
        file, module = frame.f_code.co_filename, frame.f_globals.get("__name__", "__main__")
        if file == IMPORT:
            return found, True
        if file == linecache.__file__:
            frame = _caller_of_linecache(frame)
            if frame is None:
                return {}, False
            continue
        if module.partition(".")[0] in ("experiments", "analysis"):
            break
        root = _import_folder(module, file)
        if root is not None:
            found[Path(os.path.realpath(file))] = root
        frame = frame.f_back
    return found, is_import


def _caller_of_linecache(frame: FrameType | None) -> FrameType | None:
    """The frame that called linecache, if it is an own module's; else None."""
    while frame is not None and frame.f_code.co_filename == linecache.__file__:
        frame = frame.f_back
    if frame is None:
        return None
    module = frame.f_globals.get("__name__", "__main__")
    return None if _import_folder(module, frame.f_code.co_filename) is None else frame


@cache
def _import_folder(module: str, file: str) -> Path | None:
    """The folder from which an own module is imported; None for ours, installed ones, and the program that is started."""
    path = Path(os.path.realpath(file))
    top = module.partition(".")[0]
    if top in OURS or top == "__main__" or top in sys.stdlib_module_names or not file.endswith(".py"):
        return None
    above = module.count(".") + (path.name == "__init__.py")
    return None if is_installed(path) or len(path.parents) <= above else path.parents[above]


def _root_of(path: Path, folders: Iterable[Path]) -> Path | None:
    """The folder from which a file has its name, and is found again: the first of these that a module is imported from, the
    working one, or one of Python's path; None where it is below none of them."""
    places = [Path.cwd(), *(Path(os.path.realpath(place)) for place in sys.path)]
    for folder in (one for one in (*folders, *places) if path.is_relative_to(one)):
        # A module that was loaded from its file, without an import, may lie in a folder that nothing is imported from.
        package = sys.modules.get(path.relative_to(folder).parts[0])
        if folder in places or folder in [Path(one).parent for one in getattr(package, "__path__", ())]:
            return folder
    return None


def _is_data(path: Path, root: Path | None) -> bool:
    """Whether a file may be the user's: none of ours or of an installed package, in no hidden folder, as caches are, and,
    where it is not below ``root``, none of the system's."""
    if any(path.is_relative_to(folder) for folder in OUR_FOLDERS) or is_installed(path):
        return False
    below = path if root is None else path.relative_to(root)
    is_hidden = any(part.startswith(".") for part in below.parts)
    return not is_hidden and (root is not None or not any(path.is_relative_to(one) for one in SYSTEM))


def _with_slash(name: str) -> str:
    return name if "/" in name else f"./{name}"


@cache
def _digest(path: Path, _time: int, _size: int) -> str:
    if is_source(path.name):
        return hashlib.sha256(normalised(path)).hexdigest()[:16]
    with path.open("rb") as stream:
        return hashlib.file_digest(stream, "sha256").hexdigest()[:16]


# Here, and not in a function: a module of the user's may be imported, and read, by whatever reads settings.
sys.addaudithook(_note)
