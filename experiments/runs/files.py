"""Files of a run are replaced as a whole or stay as they were: see :mod:`segar.support.files`."""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from experiments.settings import RunFolderError
from segar.support import LOCK, files, locked, remove_unfinished
from segar.support import UNFINISHED as TEMPORARY

__all__ = ["LOCK", "TEMPORARY", "locked", "remove_unfinished", "replacing", "write_bytes", "write_text"]

ADVICE = (
    "what was there before is untouched. Make room or give access, then start the same command again: it goes on from the"
    " last checkpoint"
)


@contextmanager
def replacing(path: Path) -> Iterator[Path]:
    """A path beside ``path`` to write to; it takes the place of ``path`` when the block ends without error.

    Raises:
        RunFolderError: the system refuses, for example because the disk is full; what was at ``path`` is untouched.
    """
    with files.replacing(path, path.name, RunFolderError, ADVICE, folder=True) as beside:
        yield beside


def write_bytes(path: Path, content: bytes) -> None:
    """Replaces the file at ``path`` by ``content``; raises :class:`RunFolderError`."""
    with replacing(path) as beside:
        beside.write_bytes(content)


def write_text(path: Path, content: str) -> None:
    """Replaces the file at ``path`` by ``content``; raises :class:`RunFolderError`."""
    write_bytes(path, content.encode())
