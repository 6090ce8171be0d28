"""Parquet tables that others made: what they expand to is known before they are read."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from segar.errors import SegarError
from segar.support.imports import need
from segar.support.npz import damage_told
from segar.support.reading import LIMIT, check_size, opened

CELL = 8  # [bytes] that a value takes at most, texts aside


def read_table(path: Path, kind: str, error: type[SegarError], columns: Sequence[str] | None = None) -> Any:
    """The ``pyarrow.Table`` in a Parquet file.

    Args:
        kind: what it should be, for messages, as "table".
        columns: those that are read; None: all.

    Raises:
        error: there is no such file, it is no table or has no such column, or it would take more memory than the limit.
    """
    need("reading a table", "pyarrow")
    from pyarrow import ArrowException, parquet

    unreadable = damage_told(lambda why: error(f"cannot read the {kind} {path}: {why}"), ArrowException)
    with opened(path, kind, error) as file, unreadable:
        table = parquet.ParquetFile(file)
        groups = map(table.metadata.row_group, range(table.num_row_groups))
        chunks = [group.column(k) for group in groups for k in range(group.num_columns)]
        # A number below 0, which nobody else refuses, would make room for what the others say.
        size = sum(max(one.total_uncompressed_size, 0) + CELL * max(one.num_values, 0) for one in chunks)
        check_size(path, size, kind, error)
        # Of a text that is repeated the file may hold one copy. So texts are tried in parts, which cannot be large.
        texts = [one for one in chunks if one.physical_type.endswith("BYTE_ARRAY") and is_read(one, columns)]
        most = 1 + LIMIT // max([1, *(one.total_uncompressed_size for one in texts)])
        for part in table.iter_batches(most, columns=[*{one.path_in_schema for one in texts}]):
            size += part.nbytes
            check_size(path, size, kind, error)
        return parquet.read_table(file, columns=columns)


def is_read(chunk: Any, columns: Sequence[str] | None) -> bool:
    """Whether a chunk, whose path may be ``"a.list.element"``, is of one of the columns that are read; None: of all."""
    return columns is None or any(f"{chunk.path_in_schema}.".startswith(f"{name}.") for name in columns)
