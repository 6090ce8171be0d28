"""Files that are either as they were or whole: written beside their place, then moved into it."""

from __future__ import annotations

import os
import uuid
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from segar.errors import SegarError

UNFINISHED = ".writing-"  # how the names of unfinished files begin


@contextmanager
def replacing(path: Path, what: str) -> Iterator[Path]:
    """A path beside ``path``, with the same suffix, to write to; it takes the place of ``path`` if the block ends well.

    Args:
        what: it is, for the message: "the video".

    Raises:
        SegarError: the system refuses, for example because the disk is full; what was at ``path`` is untouched.
    """
    beside = path.with_name(f"{UNFINISHED}{uuid.uuid4().hex[:12]}-{path.name}")
    try:
        yield beside
        with open(beside, "rb+") as written:
            os.fsync(written.fileno())
        os.replace(beside, path)
    except OSError as said:
        raise SegarError(f"{what} cannot be written to {path}: {said.strerror or said}; nothing was changed") from said
    finally:
        beside.unlink(missing_ok=True)


def remove_unfinished(folder: Path) -> None:
    """Remove what a killed process left half written in a folder."""
    for path in folder.glob(f"{UNFINISHED}*"):
        path.unlink(missing_ok=True)
