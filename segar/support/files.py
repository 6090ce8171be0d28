"""Whole-file writes: a file is written beside its place and then moved into it, so it is never half written; and npz archives
without pickle, of arrays and a description in JSON."""

import json
import os
import uuid
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from segar.errors import SegarError
from segar.support.json_forms import from_json, misfit
from segar.support.npz import LIMIT, Form, first_line, open_npz
from segar.support.version import __version__

UNFINISHED = ".writing-"  # how the names of unfinished files begin
LONGEST_DESCRIPTION = 8 * 2**20  # [bytes] of an archive; those of the largest worlds take a tenth


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
        limit: [bytes] to which a file may expand when it is read, if it is not large itself; see
            :func:`segar.support.npz.file_limit`.
    """

    name: str
    version: int
    contents: str
    file: str
    error: type[SegarError]
    limit: int = LIMIT

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

    def read(
        self, path: Path, forms: Callable[[dict[str, Any]], Mapping[str, Form]]
    ) -> tuple[dict[str, np.ndarray], dict[str, Any]]:
        """Return arrays, and the description. The headers of all arrays are checked before one is expanded.

        Args:
            forms: function of the description: the names of the arrays to read, and what each must be.

        Raises:
            error: there is no such file, it is no archive of this format, it is incomplete, its arrays have other forms,
                it would expand to more than the limit, or it is of a newer version.
        """
        with open_npz(path, self.file, self.error, self.limit) as npz:
            header = npz.header("metadata")
            if header.dtype != np.uint8 or len(header.shape) != 1 or header.shape[0] > LONGEST_DESCRIPTION:
                raise self.error(
                    f"{path} is not a {self.file}: its description, the array 'metadata', must be uint8 of at most"
                    f" {LONGEST_DESCRIPTION:,} numbers, not {header.dtype} of shape {header.shape}"
                )
            text = npz.read({"metadata": Form("uint8", ("bytes",))})["metadata"].tobytes()
            metadata = self._checked_description(path, text)
            return npz.read(forms(metadata)), metadata

    def check(self, path: Path, metadata: Mapping[str, Any], form: Mapping[str, Any]) -> None:
        """Raise :attr:`error` unless the description has the form; see :func:`segar.support.json_forms.misfit`."""
        wrong = misfit(metadata, form)
        if wrong:
            raise self.error(
                f"{path} is not a {self.file}, or a damaged one: in its description {wrong}; save it again"
            )

    def _checked_description(self, path: Path, text: bytes) -> dict[str, Any]:
        try:
            metadata = from_json(text)
        except ValueError as cause:
            raise self.error(
                f"{path} is not a {self.file}, or only part of one: its description is no JSON ({first_line(cause)}); save"
                " or copy it again"
            ) from cause
        found = metadata.get("format") if isinstance(metadata, dict) else None
        if found != self.name:
            raise self.error(f"{path} is not a {self.file}, whose format is '{self.name}'; its format is '{found}'")
        self.check(path, metadata, {"format_version?": int})
        if metadata.get("format_version", 0) > self.version:
            raise self.error(
                f"{path} was written by a newer SEGAR ({metadata.get('version')}), which this one cannot read; install that"
                " version"
            )
        return metadata
