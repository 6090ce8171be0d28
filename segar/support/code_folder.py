"""Where machine code is kept: in a folder to which nobody but the user and root can write, because numba keeps pickles, which
run code when they are read."""

import errno
import os
import stat
import sys
from functools import cache
from pathlib import Path

from segar.errors import SegarError

FOLDER = "SEGAR_CACHE_DIR"  # the variable that names the folder
MACHINE_CODE = "__pycache__"  # where numba keeps it, beside the kernels
OWN, OTHERS_WRITE = 0o700, stat.S_IWGRP | stat.S_IWOTH
ROOT = 0  # the user who may bring ready kernels
ADVICE = f"set {FOLDER} to a folder that can be written"


def cache_folder() -> Path:
    """Where kernels are looked for first: ``$SEGAR_CACHE_DIR``, else the user's cache folder, else a temporary one."""
    return [*_usual(), *_temporary()][0]


def private_cache_folder() -> Path:
    """The first folder that the user can write to, made if need be; nobody else but root can write to it.

    Raises:
        SegarError: a folder belongs to somebody else, others can write to it, the one that ``$SEGAR_CACHE_DIR`` names cannot
            be made, or there is no other one.
    """
    why = ""
    for folder in (*_usual(), *_temporary()):
        try:
            _make_private(folder)
            return folder
        except OSError as cause:
            why = f"kernels cannot be kept in {folder}: {cause.strerror}; {ADVICE}"
            if str(folder) == os.environ.get(FOLDER) and not os.path.isdir(folder):
                break
    raise SegarError(why)


def is_trusted(folder: Path) -> bool:
    """Whether nobody but the user and root could have put kernels there."""
    try:
        return not any(_strangers(path) or _others_write(path) for path in (folder, folder / MACHINE_CODE))
    except OSError:
        return False


@cache
def say_where_kept(folder: Path) -> None:
    """Tell the person once that machine code is not kept in the usual folder."""
    if folder not in _usual()[:1]:
        why = f"{_usual()[0]} cannot be written" if _usual() else "there is no home folder"
        print(f"segar: {why}; machine code is kept in {folder}, or {ADVICE}", file=sys.stderr, flush=True)


def _usual() -> list[Path]:
    """The folder that the user names, and the one in the user's home; a variable that is empty counts as none."""
    named, home = os.environ.get(FOLDER), os.environ.get("XDG_CACHE_HOME") or os.path.expanduser("~/.cache")
    own = [] if home.startswith("~") else [Path(home) / "segar" / "kernels"]  # an unknown user has no home
    return [*([Path(named)] if named else []), *own]


def _temporary() -> list[Path]:
    """Where kernels are kept that cannot be kept in the usual folders."""
    return [Path(place or "/tmp") / f"segar-{os.geteuid()}" for place in (os.environ.get("TMPDIR"), "/tmp", "/dev/shm")]


def _make_private(folder: Path) -> None:
    """Make a folder that can be written; raises :class:`OSError` where it cannot."""
    compiled, mode = folder / MACHINE_CODE, OWN
    for path in (folder, compiled):
        path.mkdir(parents=True, exist_ok=True, mode=mode)
        mode = stat.S_IMODE(path.stat().st_mode)
        for stranger in _strangers(path):
            raise SegarError(
                f"{path} belongs to user {stranger}, whose kernels would run as you; set {FOLDER} to a folder of your own"
            )
        if _others_write(path):
            raise SegarError(
                f"others can write to {path}, and their kernels would run as you: chmod go-w {path}, or set {FOLDER} to"
                " a folder of your own"
            )
    if not all(os.access(path, os.W_OK, effective_ids=True) for path in (folder, compiled)):
        raise PermissionError(errno.EACCES, os.strerror(errno.EACCES))


def _strangers(path: Path) -> set[int]:
    """Who owns a folder, or a link to it, and is neither the user nor root."""
    return {path.lstat().st_uid, path.stat().st_uid} - {os.geteuid(), ROOT}


def _others_write(path: Path) -> bool:
    return bool(path.stat().st_mode & OTHERS_WRITE)
