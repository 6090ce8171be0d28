"""Whole-file writes: a file is written beside its place and then moved into it, so it is never half written; and npz archives
without pickle, of arrays and a description in JSON."""

import json
import os
import uuid
import zipfile
import zlib
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from segar.errors import SegarError
from segar.support.version import __version__

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


@dataclass(frozen=True)
class ArchiveFormat:
    """One kind of archive.

    Attributes:
        name: of the format, stored in the archive, e.g. ``segar-levels``.
        version: of the format; it grows when older versions of SEGAR can no longer read new archives.
        contents, file: words for messages: what the archive holds and what it is, e.g. ``levels`` and ``level file``.
        error: the class of the errors that reading and writing raise.
    """

    name: str
    version: int
    contents: str
    file: str
    error: type[SegarError]

    def write(self, path: Path, arrays: Mapping[str, np.ndarray], metadata: Mapping[str, Any]) -> None:
        """Write arrays and description to ``path``, by way of a file beside it.

        Args:
            metadata: the description; a ``version`` in it replaces that of this package.

        Raises:
            error: the file cannot be written; what stood at ``path`` still stands there.
        """
        head = {"format": self.name, "format_version": self.version, "version": __version__}
        text = json.dumps(head | dict(metadata), indent=1).encode()
        contents: dict[str, Any] = {**arrays, "metadata": np.frombuffer(text, dtype=np.uint8)}
        with replacing(path, self.contents, self.error) as beside, open(beside, "wb") as file:
            np.savez_compressed(file, **contents)

    def read(self, path: Path, names: Iterable[str]) -> tuple[dict[str, np.ndarray], dict[str, Any]]:
        """Return the arrays of these names, and the description.

        Raises:
            error: there is no such file, it is no archive of this format, it is incomplete, or of a newer version.
        """
        if not path.exists():
            raise self.error(f"there is no {self.file} {path}")
        if not zipfile.is_zipfile(path):
            raise self.error(f"{path} is not a {self.file}, or only part of one; save or copy it again")
        try:
            with np.load(path, allow_pickle=False) as archive:
                arrays = {name: archive[name] for name in names}
                metadata = json.loads(archive["metadata"].tobytes())
        except (zipfile.BadZipFile, zlib.error, KeyError, ValueError, EOFError, OSError) as cause:
            raise self.error(
                f"{path} is not a {self.file}, or only part of one: {cause}; save or copy it again"
            ) from cause
        found = metadata.get("format") if isinstance(metadata, dict) else None
        if found != self.name:
            raise self.error(f"{path} is not a {self.file}, whose format is '{self.name}'; its format is '{found}'")
        if metadata.get("format_version", 0) > self.version:
            raise self.error(
                f"{path} was written by a newer SEGAR ({metadata.get('version')}), which this one cannot read; install that"
                " version"
            )
        return arrays, metadata
