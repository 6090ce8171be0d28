"""Opening files that somebody else may have made: regular files alone, and no more of one than memory should hold."""

import hashlib
import os
import stat
from collections.abc import Iterator
from contextlib import contextmanager
from io import BufferedReader
from pathlib import Path

from segar.errors import SegarError

LIMIT = 256 * 2**20  # [bytes] of a text, and to which a small file may expand
RATIO = 100  # a larger file may expand to so many times its size; level files take a seventh to a thirtieth
LIMIT_VARIABLE = "SEGAR_FILE_LIMIT"  # [MB] the environment variable that says another limit
KINDS = {"d": "a folder", "c": "a device", "b": "a device", "p": "a pipe", "s": "a socket"}  # by letters of `ls -l`


@contextmanager
def opened(path: Path, kind: str, error: type[SegarError]) -> Iterator[BufferedReader]:
    """A file to read from, which is a regular one: a pipe could keep its reader waiting, and a device has no end.

    Args:
        kind: what it should be, for messages, as "level file".

    Raises:
        error: there is no such file, it cannot be read, or it is a folder, a pipe or a device.
    """
    try:
        descriptor = os.open(path, os.O_RDONLY | os.O_NONBLOCK | os.O_CLOEXEC)
    except FileNotFoundError as cause:
        raise error(f"there is no {kind} {path}") from cause
    except (OSError, ValueError) as cause:  # a name may hold what no name of a file can
        raise error(f"cannot read the {kind} {path}: {getattr(cause, 'strerror', None) or cause}") from cause
    other = kind_of(os.fstat(descriptor).st_mode)
    if other is not None:
        os.close(descriptor)
        raise error(f"{path} is no {kind}: it is {other}")
    with open(descriptor, "rb") as file:
        yield file


def content_of(path: Path, kind: str, error: type[SegarError], limit: int = LIMIT) -> bytes:
    """The bytes in a file.

    Args:
        kind: as of :func:`opened`.
        limit: how many bytes it may have, unless the environment variable says another limit.

    Raises:
        error: as of :func:`opened`; or the file is larger.
    """
    most = file_limit(limit)
    with opened(path, kind, error) as file:
        size = os.fstat(file.fileno()).st_size
        content = b"" if size > most else file.read(most + 1)  # of some files, the system states no size
    if max(size, len(content)) > most:
        raise error(f"{path}: this {kind} has more than {most:,} bytes. {advice(max(size, most + 1))}")
    return content


def sha256_of(path: Path, kind: str, error: type[SegarError]) -> str:
    """The SHA-256 of a file, in hexadecimal digits; raises ``error`` as :func:`opened`."""
    with opened(path, kind, error) as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def check_size(path: Path, size: int, file: str, error: type[SegarError], limit: int = LIMIT) -> None:
    """Raise ``error`` where a file would expand to so many bytes, and that is more than the limit; see :func:`file_limit`."""
    there = path.stat().st_size
    most = file_limit(limit, there)
    if size > most:
        raise error(
            f"{path}: this {file} of {there:,} bytes would expand to {size:,}, more than {most:,}. {advice(size)}"
        )


def advice(size: int) -> str:
    """What to do about a file of so many bytes that is refused."""
    megabytes = -(-size // 10**6)
    return f"If you know where it comes from, set the environment variable {LIMIT_VARIABLE} to {megabytes} (megabytes) or more"


def file_limit(limit: int, size: int = 0) -> int:
    """To how many bytes a file of so many bytes may expand.

    Raises:
        SegarError: the environment variable that says it is no number.
    """
    given = os.environ.get(LIMIT_VARIABLE, "")
    if not given:
        return max(limit, RATIO * size)
    if not given.isdecimal():
        raise SegarError(
            f"the environment variable {LIMIT_VARIABLE} is a number of megabytes, such as 4000, not {given!r}"
        )
    return int(given) * 10**6


def kind_of(mode: int) -> str | None:
    """What has this mode, in words; None for a regular file."""
    letter = stat.filemode(mode)[0]
    return None if letter == "-" else KINDS.get(letter, "something else")
