"""Files of a run are replaced as a whole or stay as they were: see :mod:`segar.support.files`. They are read as data, whoever
made them."""

from collections.abc import Sequence
from contextlib import AbstractContextManager
from pathlib import Path
from typing import Any

import pyarrow as pa
import pyarrow.parquet as pq

from segar import support
from segar.experiments.settings import RunFolderError
from segar.support import data_in, files

ADVICE = (
    "what was there before is untouched. Make room or give access, then start the same command again: it goes on from the"
    " last checkpoint"
)


def replacing(path: Path) -> AbstractContextManager[Path]:
    """A path beside ``path`` to write to; it takes the place of ``path`` when the block ends without error.

    Raises:
        RunFolderError: the system refuses, for example because the disk is full; what was at ``path`` is untouched.
    """
    return files.replacing(path, path.name, RunFolderError, ADVICE, folder=True)


def write_bytes(path: Path, content: bytes) -> None:
    """Replaces the file at ``path`` by ``content``; raises :class:`RunFolderError`."""
    with replacing(path) as beside:
        beside.write_bytes(content)


def write_text(path: Path, content: str) -> None:
    """Replaces the file at ``path`` by ``content``; raises :class:`RunFolderError`."""
    write_bytes(path, content.encode())


def write_parquet(path: Path, table: pa.Table, compression: str = "snappy") -> None:
    """Replaces the Parquet file at ``path`` by ``table``; raises :class:`RunFolderError`."""
    with replacing(path) as beside:
        pq.write_table(table, beside, compression=compression)


def read_json(path: Path, form: Any = dict, only: bool = False) -> Any:
    """The data in a JSON file.

    Args:
        form, only: what they must be; see :func:`segar.support.misfit`.

    Raises:
        RunFolderError: there is no such file, it is no JSON, or the data are of another form; the message names the place.
    """
    return data_in(path, f"a {path.name}", RunFolderError, form=form, only=only)


def read_table(path: Path, columns: Sequence[str] | None = None) -> pa.Table:
    """The table in a Parquet file.

    Raises:
        RunFolderError: there is no such file, it is no table, or would take more memory than the limit.
    """
    return support.read_table(path, "table", RunFolderError, columns)
