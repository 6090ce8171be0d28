"""Whole-file writes: a file is written beside its place and then moved into it, so it is never half written."""

import os
import uuid
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from segar.errors import SegarError

UNFINISHED = ".writing-"  # how the names of unfinished files begin


@contextmanager
def replacing(
    path: Path,
    what: str,
    error: type[SegarError] = SegarError,
    advice: str = "nothing was changed",
    folder: bool = False,
) -> Iterator[Path]:
    """A path beside ``path``, with the same suffix, to write to; it takes the place of ``path`` if the block ends well.

    Args:
        what: the name of the contents in the message, such as "the video".
        advice: how the message ends.
        folder: make the folder of ``path`` if it is not there.

    Raises:
        error: the system refuses, for example because the disk is full; what was at ``path`` is untouched.
    """
    # Never the same name twice: libraries keep connections to a database by its name, also to one that failed.
    beside = path.with_name(f"{UNFINISHED}{uuid.uuid4().hex[:12]}-{path.name}")
    try:
        if folder:
            path.parent.mkdir(parents=True, exist_ok=True)
        yield beside
        with open(beside, "rb+") as written:
            os.fsync(written.fileno())
        os.replace(beside, path)
    except OSError as cause:
        raise error(f"{what} cannot be written to {path}: {cause.strerror or cause}; {advice}") from cause
    finally:
        with suppress(NotADirectoryError):  # a file stands where its folder should be
            beside.unlink(missing_ok=True)


def remove_unfinished(folder: Path) -> None:
    """Remove what a killed process left half written in a folder and the folders in it."""
    for path in folder.rglob(f"{UNFINISHED}*"):
        path.unlink(missing_ok=True)
