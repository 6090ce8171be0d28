"""Files in which every name was replaced on purpose, and a watch on what a process does while it reads them."""

import os
import sys
import warnings
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from segar.errors import SegarError
from tests.crafted import at, places, replaced

SECRET = "known-to-the-environment-alone"
MODULE, FILE = "hostile_module", "hostile_file"
WATCHED = (
    "subprocess.",
    "os.system",
    "os.exec",
    "os.posix_spawn",
    "os.fork",
    "pty.",
    "socket.connect",
    "ctypes.dlopen",
)

_seen: list[str] = []  # what happened since the watch began
_is_watching = False


def names(folder: Path) -> dict[str, str]:
    """What stands in place of names; Python finds :data:`MODULE`, and the folder has the file of :data:`FILE`."""
    return {
        "an attribute of a module of ours": "segar.engine.targets.numba_ir:subprocess.run",
        "Python's": "os:system",
        "a module": f"{MODULE}:run",
        "a class": f"{MODULE}.Config",
        "a file": f"{folder}/{FILE}.py:run",
        "a class in a file": f"{folder}/{FILE}.py.Config",
        "a folder above": "../../../etc/passwd",
        "a level file that is a pipe": f"{folder}/pipe.json",
        "a level file that has no end": f"{folder}/endless.npz",
        "a null": f"{MODULE}\0:run",
        "letters beyond ASCII": f"{MODULE}:rün",
        "very long": f"{MODULE}:" + "x" * 100_000,
        "an interpolation": "${oc.env:HOSTILE_SECRET}",
        "nothing": "",
    }


@contextmanager
def hostile_folder(folder: Path) -> Iterator[Path]:
    """A folder with a module and a file that leave a mark when they are imported, a pipe, and a link to a device; Python looks
    for modules in it. Yields the mark."""
    mark = folder / "mark"
    for name in (MODULE, FILE):
        where = folder / "modules" if name == MODULE else folder
        where.mkdir(parents=True, exist_ok=True)
        (where / f"{name}.py").write_text(f"open({str(mark)!r}, 'w').close()\nrun = Config = print\n")
    os.mkfifo(folder / "pipe.json")
    (folder / "endless.npz").symlink_to("/dev/zero")
    before = list(sys.path)
    sys.path.append(str(folder / "modules"))
    try:
        yield mark
    finally:
        sys.path[:] = before


def assert_nothing_runs(data: Any, write: Callable[[Any], Path], read: Callable[[], Any], folder: Path) -> None:
    """Every text in the data is replaced by every hostile name. Reading them runs nothing, and ends well or with an error of
    SEGAR that names the file and either the place or the name.

    Args:
        write: writes the file; returns its path.
        read: reads it, and makes of it whatever its names stand for.
        folder: for hostile files.
    """
    wrong, count = [], 0
    with hostile_folder(folder) as mark:
        modules, path_before = set(sys.modules), list(sys.path)
        for place in (one for one in places(data) if isinstance(at(data, one), str)):
            for what, value in names(folder).items():
                told = f"{'.'.join(map(str, place))}: {what}"
                count += 1
                with watching() as seen:
                    outcome = _outcome(data, place, value, write, read)
                if outcome:
                    wrong.append(f"{told}: {outcome}")
                if seen or mark.exists() or sys.path != path_before:
                    found = f"mark {mark.exists()}, path {sys.path[len(path_before) :]}"
                    wrong.append(f"{told}: it ran {seen[:3]}, {found}")
                    mark.unlink(missing_ok=True)
                    sys.path[:] = path_before
                if foreign := {one for one in set(sys.modules) - modules if one.startswith((MODULE, FILE))}:
                    wrong.append(f"{told}: it imported {foreign}")
                    for one in foreign:
                        del sys.modules[one]
    assert count and not wrong, f"{len(wrong)} of {count}:\n" + "\n".join(one[:400] for one in wrong[:60])


def _outcome(
    data: Any, place: tuple[Any, ...], value: str, write: Callable[[Any], Path], read: Callable[[], Any]
) -> str:
    """What is wrong with how reading ended."""
    file, known = write(replaced(data, place, value)), at(data, place)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            read()
    except SegarError as error:
        text = str(error)
        keys = [known, *(str(key) for key in place if isinstance(key, str))]  # one name of two that do not fit any more
        if SECRET in text:
            return f"tells a secret: {text}"
        if file.name not in text:
            return f"does not name {file.name}: {text}"
        if not any(key in text for key in keys) and ascii(value)[1:20] not in text and value[:20] not in text:
            return f"names neither {keys} nor the name: {text}"
    except Exception as error:  # which is what must not be
        return f"{type(error).__name__}: {error}"
    return ""


@contextmanager
def watching() -> Iterator[list[str]]:
    """What happens in the block that no reader may do: processes, connections, and imports of hostile modules."""
    global _is_watching
    if not getattr(sys, "_segar_watch", False):
        sys.addaudithook(_watch)
        sys._segar_watch = True  # type: ignore[attr-defined]
    _seen.clear()
    _is_watching = True
    try:
        yield _seen
    finally:
        _is_watching = False


def _watch(event: str, arguments: tuple[Any, ...]) -> None:
    if not _is_watching:
        return
    if event.startswith(WATCHED) or (event == "import" and str(arguments[0]).startswith((MODULE, FILE))):
        _seen.append(f"{event} {str(arguments)[:80]}")
