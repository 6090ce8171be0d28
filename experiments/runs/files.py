"""Files of a run are replaced as a whole or stay as they were: see :mod:`segar.support.files`. They are read as data, whoever
made them."""

from collections.abc import Iterator
from contextlib import AbstractContextManager, contextmanager
from io import BufferedReader
from pathlib import Path
from typing import Any

import pyarrow as pa
import pyarrow.parquet as pq

from segar.experiments.settings import RunFolderError
from segar.support import DAMAGE, check_size, data_in, files, first_line, opened

CELL = 8  # [bytes] that a value of a table takes at most, texts aside

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


def read_table(path: Path) -> pa.Table:
    """The table in a Parquet file.

    Raises:
        RunFolderError: there is no such file, it is no table, or would take more memory than the limit.
    """
    with opened_table(path) as file:
        return pq.read_table(file)


@contextmanager
def opened_table(path: Path) -> Iterator[BufferedReader]:
    """A Parquet file to read from, which is not too large; errors in the block are those of :func:`read_table`."""
    with opened(path, "table", RunFolderError) as file:
        try:
            found = pq.read_metadata(file)
            check_size(path, CELL * found.num_rows * found.num_columns, "table", RunFolderError)
            yield file
        except RunFolderError:
            raise
        except (pa.ArrowException, *DAMAGE) as error:
            raise RunFolderError(f"cannot read the table {path}: {first_line(error)}") from error
