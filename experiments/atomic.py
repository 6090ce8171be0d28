"""Files that are either as they were or whole: written beside their place, then moved into it."""

from __future__ import annotations

import os
import uuid
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from experiments.errors import RunFolderError

TEMPORARY = ".writing-"  # how the names of unfinished files begin


@contextmanager
def replacing(path: Path) -> Iterator[Path]:
    """A path beside ``path`` to write to; it takes the place of ``path`` when the block ends without error.

    Raises:
        RunFolderError: the system refuses, for example because the disk is full; what was at ``path`` is untouched.
    """
    # Never the same name twice: libraries keep connections to a database by its name, also to one that failed.
    beside = path.with_name(f"{TEMPORARY}{uuid.uuid4().hex[:12]}-{path.name}")
    try:
        path.parent.mkdir(exist_ok=True)
        yield beside
        with open(beside, "rb+") as written:
            os.fsync(written.fileno())
        os.replace(beside, path)
    except OSError as error:
        raise RunFolderError(
            f"cannot write {path}: {error.strerror or error}; what was there before is untouched. "
            "Make room or give access, then start the same command again: it goes on from the last checkpoint"
        ) from error
    finally:
        beside.unlink(missing_ok=True)


def write_bytes(path: Path, content: bytes | memoryview) -> None:
    """Replaces the file at ``path`` by ``content``; raises :class:`RunFolderError`."""
    with replacing(path) as beside:
        beside.write_bytes(content)


def write_text(path: Path, content: str) -> None:
    """Replaces the file at ``path`` by ``content``; raises :class:`RunFolderError`."""
    write_bytes(path, content.encode())


def remove_unfinished(folder: Path) -> None:
    """Removes what a killed process left half written."""
    for path in folder.rglob(f"{TEMPORARY}*"):
        path.unlink(missing_ok=True)
