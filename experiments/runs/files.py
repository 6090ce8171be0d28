"""Files of a run are replaced as a whole or stay as they were: see :mod:`segar.support.files`. They are read as data, whoever
made them."""

from collections.abc import Sequence
from contextlib import AbstractContextManager
from pathlib import Path
from typing import Any

import pyarrow as pa
import pyarrow.parquet as pq

from segar import support
from segar.errors import did_you_mean
from segar.experiments.settings import RunFolderError
from segar.support import data_in, files, first_line, shown

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


def absolute_path(path: Path | str) -> Path:
    """The absolute path of a file or folder, ~ and links resolved; raises :class:`RunFolderError` where there can be none."""
    try:
        found = Path(path).expanduser().resolve()
        str(found).encode()  # not every library takes names that are no text
        found.exists()
    except (OSError, RuntimeError, ValueError) as error:
        raise RunFolderError(
            f"{shown(str(path))} is no place for files: {error}; choose another, or set PYTHONUTF8=1"
        ) from error
    return found


def make_folder(path: Path) -> None:
    """Makes a folder unless it is there; raises :class:`RunFolderError` where the system refuses."""
    try:
        path.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise RunFolderError(f"cannot make the folder {path}: {error.strerror}; choose another one") from error


def write_bytes(path: Path, content: bytes) -> None:
    """Replaces the file at ``path`` by ``content``; raises :class:`RunFolderError`."""
    with replacing(path) as beside:
        beside.write_bytes(content)


def write_text(path: Path, content: str) -> None:
    """Replaces the file at ``path`` by ``content``; raises :class:`RunFolderError`."""
    write_bytes(path, content.encode())


def write_parquet(path: Path, table: pa.Table, compression: str = "snappy") -> None:
    """Replaces the Parquet file at ``path`` by ``table``, whose floats are split by bytes, so that they become smaller.

    Raises:
        RunFolderError: the file cannot be written.
    """
    floats = {one.name: "BYTE_STREAM_SPLIT" for one in table.schema if pa.types.is_floating(one.type)}
    others: Any = [name for name in table.column_names if name not in floats]  # the stubs know no lists
    with replacing(path) as beside:
        pq.write_table(table, beside, compression=compression, use_dictionary=others, column_encoding=floats)


def read_json(path: Path, form: Any = dict, only: bool = False) -> Any:
    """The data in a JSON file.

    Args:
        form, only: what they must be; see :func:`segar.support.misfit`.

    Raises:
        RunFolderError: there is no such file, it is no JSON, or the data are of another form; the message names the place.
    """
    return data_in(path, f"a {path.name}", RunFolderError, form=form, only=only)


def read_table(path: Path, columns: Sequence[str] | None = None, schema: pa.Schema | None = None) -> pa.Table:
    """The table in a Parquet file.

    Args:
        schema: the columns that it must have, which come in these types; others are left as they are.

    Raises:
        RunFolderError: there is no such file, it is no table, lacks a column, has one of another kind, or would take more
            memory than the limit.
    """
    table = support.read_table(path, "table", RunFolderError, columns)
    about = {key: text for key, text in (table.schema.metadata or {}).items() if key != b"pandas"}
    table = table.replace_schema_metadata(about or None)  # pandas believes what it says of types, whoever wrote it
    return table if schema is None else typed(path, table, schema)


def typed(path: Path, table: pa.Table, schema: pa.Schema) -> pa.Table:
    """The table of the file ``path`` with the columns of ``schema`` in its types; others are left as they are. Raises
    :class:`RunFolderError` where a column is missing or of another kind, a value is absent, or a whole number below 0."""
    for one in schema:
        place, names = table.schema.get_field_index(one.name), table.schema.names
        if place < 0:
            raise RunFolderError(f"{path} has no column '{one.name}', or several.{did_you_mean(one.name, names)}")
        try:
            table = table.set_column(place, one, column := table.column(place).cast(one.type))
        except pa.ArrowException as error:
            raise RunFolderError(f"{path}: its column '{one.name}' is of another kind: {first_line(error)}") from error
        if column.null_count:
            raise RunFolderError(f"{path}: in its column '{one.name}' something is absent; restore the file")
        if pa.types.is_integer(one.type) and min(column.to_pylist(), default=0) < 0:
            raise RunFolderError(f"{path}: in its column '{one.name}' something is below 0; restore the file")
    return table
