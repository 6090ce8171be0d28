"""Whole-file writes: a file is written beside its place and then moved into it, so it is never half written; and npz archives
without pickle, of arrays and a description in JSON."""

import errno
import fcntl
import json
import os
import stat
import uuid
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from filelock import FileLock, Timeout

from segar.errors import SegarError
from segar.support.json_forms import from_json, misfit
from segar.support.npz import Form, damage_told, open_npz
from segar.support.reading import LIMIT, kind_of
from segar.support.version import __version__

UNFINISHED = ".writing-"  # how the names of unfinished files begin
LONGEST_DESCRIPTION = 8 * 2**20  # [bytes] of an archive; those of the largest worlds take a tenth
LOCK = ".lock"
LOCK_TIMEOUT = 0.5  # [s]; longer than another process holds the lock to see whether it is free
PRIVATE = 0o600  # mode of what will replace a file, which may be one that only its owner reads


@contextmanager
def replacing(
    path: Path,
    what: str,
    error: type[SegarError] = SegarError,
    advice: str = "nothing was changed",
    folder: bool = False,
) -> Iterator[Path]:
    """A path beside ``path``, with the same suffix, to write to; it takes the place of ``path`` if the block ends well.

    Where ``path`` is a symbolic link, the link stays and the file that it leads to is replaced. A file that is replaced
    hands on its permissions. What killed processes left half written in the folder is removed.

    Args:
        what: the name of the contents in the message, such as "the video".
        advice: how the message ends.
        folder: make the folder of ``path`` if it is not there.

    Raises:
        error: the system refuses, for example because the disk is full, or something else than a file stands at ``path``;
            what was there is untouched.
    """
    try:
        there = _status(path)
        kind = None if there is None else kind_of(there.st_mode)
        if kind is not None:
            raise error(f"{what} cannot be written to {path}: it is {kind} and no file; name a file")
        target = Path(os.path.realpath(path))
        if folder:
            target.parent.mkdir(parents=True, exist_ok=True)
        remove_unfinished(target.parent, recursive=False)
        with _unfinished(target.parent, path.suffix, 0o666 if there is None else PRIVATE) as beside:
            yield beside
            with open(beside, "rb+") as written:
                os.fsync(written.fileno())
            if there is not None:
                os.chmod(beside, stat.S_IMODE(there.st_mode))
            os.replace(beside, target)
    except OSError as cause:
        raise error(f"{what} cannot be written to {path}: {cause.strerror or cause}; {advice}") from cause


def remove_unfinished(folder: Path, recursive: bool = True) -> None:
    """Remove what killed processes left half written in a folder, and in the folders in it; leave what others write now."""
    found = sorted(folder.rglob(f"{UNFINISHED}*") if recursive else folder.glob(f"{UNFINISHED}*"))
    written: list[str] = []
    for path in found:
        # A database that is being made has files beside it, whose names begin with its own.
        if any(str(path).startswith(name) for name in written):
            continue
        if not _remove_abandoned(path):
            written.append(str(path))


@contextmanager
def locked(
    folder: Path, error: type[SegarError], advice: str, timeout: float = LOCK_TIMEOUT, name: str = LOCK
) -> Iterator[None]:
    """Keep other processes out of a folder, which is made if it is not there, inside the block, by a lock on a file in it.

    Args:
        advice: how the message ends.
        timeout: [s] to wait for another process.
        name: of the file.

    Raises:
        error: another process is at work in the folder, or the file cannot be made.
    """
    try:
        folder.mkdir(parents=True, exist_ok=True)
        held = FileLock(folder / name, timeout=timeout).acquire()
    except Timeout:
        raise error(f"another process is at work in {folder}; {advice}") from None
    except (OSError, NotImplementedError) as cause:
        raise error(f"cannot use the folder {folder}: {getattr(cause, 'strerror', None) or cause}") from cause
    with held:
        yield


def _status(path: Path) -> os.stat_result | None:
    """The status of what stands at a path, beyond symbolic links; None if there is nothing."""
    try:
        return os.stat(path)
    except FileNotFoundError:
        return None
    except ValueError as cause:
        raise OSError(errno.EINVAL, str(cause)) from cause


@contextmanager
def _unfinished(folder: Path, suffix: str, mode: int) -> Iterator[Path]:
    """A new file in a folder, locked so that others see that its maker is alive; removed at the end if it is still there."""
    beside, descriptor = _locked_file(folder, suffix, mode)
    try:
        yield beside
    finally:
        beside.unlink(missing_ok=True)
        os.close(descriptor)


def _locked_file(folder: Path, suffix: str, mode: int) -> tuple[Path, int]:
    """A new file, and the descriptor that holds its lock."""
    while True:
        # Never the same name twice: libraries keep connections to a database by its name, also to one that failed.
        path = folder / f"{UNFINISHED}{uuid.uuid4().hex}{suffix}"
        descriptor = os.open(path, os.O_RDWR | os.O_CREAT | os.O_EXCL, mode)
        try:
            fcntl.flock(descriptor, fcntl.LOCK_EX)
        except OSError:  # this file system has no locks, so nobody takes the file for abandoned
            return path, descriptor
        if os.fstat(descriptor).st_nlink:
            return path, descriptor
        os.close(descriptor)  # another process took the file for abandoned before it was locked


def _remove_abandoned(path: Path) -> bool:
    """Remove an unfinished file unless its maker, who holds a lock on it, is alive; return whether it is gone."""
    try:
        descriptor = os.open(path, os.O_RDWR | os.O_NOFOLLOW)
    except OSError:  # another user's, or its maker has just removed it
        return False
    try:
        fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
        path.unlink(missing_ok=True)
    except OSError:  # locked, on a file system without locks, or in a folder that cannot be changed
        return False
    finally:
        os.close(descriptor)
    return True


@dataclass(frozen=True)
class ArchiveFormat:
    """One kind of archive.

    Attributes:
        name: of the format, stored in the archive, e.g. ``segar-levels``.
        version: of the format; it grows when older versions of SEGAR can no longer read new archives.
        contents, file: words for messages: what the archive holds and what it is, e.g. ``levels`` and ``level file``.
        error: the class of the errors that reading and writing raise.
        description: the form of the description; see :func:`segar.support.json_forms.misfit`.
        limit: [bytes] to which a file may expand when it is read, if it is not large itself; see
            :func:`segar.support.reading.file_limit`.
    """

    name: str
    version: int
    contents: str
    file: str
    error: type[SegarError]
    description: Mapping[str, Any]
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
            forms: function of the description, which has its form: the names of the arrays to read, and what each must be.

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

    def _check(self, path: Path, metadata: Mapping[str, Any], form: Mapping[str, Any]) -> None:
        """Raise :attr:`error` unless the description has the form."""
        if wrong := misfit(metadata, form):
            raise self.error(
                f"{path} is not a {self.file}, or a damaged one: in its description {wrong}; save it again"
            )

    def _checked_description(self, path: Path, text: bytes) -> dict[str, Any]:
        told = f"{path} is not a {self.file}, or only part of one: its description is no JSON"
        with damage_told(lambda why: self.error(f"{told} ({why}); save or copy it again")):
            metadata = from_json(text)
        found = metadata.get("format") if isinstance(metadata, dict) else None
        if found != self.name:
            raise self.error(f"{path} is not a {self.file}, whose format is '{self.name}'; its format is '{found}'")
        self._check(path, metadata, {"format_version?": int})
        if metadata.get("format_version", 0) > self.version:
            raise self.error(
                f"{path} was written by a newer SEGAR ({metadata.get('version')}), which this one cannot read; install that"
                " version"
            )
        self._check(path, metadata, self.description)
        return metadata
