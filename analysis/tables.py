"""Short functions on tables: rows, columns, means, CSV files."""

from collections.abc import Iterable, Sequence
from io import BytesIO
from pathlib import Path
from typing import Any, cast

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from segar.errors import SegarError, naming
from segar.experiments.runs.files import read_table, replacing
from segar.experiments.settings import RunFolderError, require
from segar.support import data_in

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

MOST_COLUMNS = 10_000  # of a text, for each of which reading takes about a millisecond
CURVE_POINTS = 40  # of a curve that is drawn or shipped


def write_csv(path: Path, table: pd.DataFrame, digits: int | None = None) -> None:
    """Replaces a CSV file, and makes its folder; raises :class:`RunFolderError`.

    Numbers have so many significant ``digits``, or all that they have.
    """
    form = None if digits is None else f"%.{digits}g"
    with replacing(path) as beside:
        table.to_csv(beside, index=False, float_format=form, lineterminator="\n")


def write_table(path: Path, table: pd.DataFrame) -> None:
    """Replaces a file ``.csv`` or ``.parquet``, as its suffix says; raises :class:`RunFolderError`."""
    if path.suffix == ".csv":
        write_csv(path, table)
        return
    with replacing(path) as beside:
        table.to_parquet(beside, index=False)


def read_frame(path: Path) -> pd.DataFrame:
    """The table in a file ``.csv`` or ``.parquet``, as its suffix says; raises :class:`RunFolderError` where there is none."""
    if path.suffix == ".parquet":
        table = read_table(path)
        with naming(path, RunFolderError):
            for one in table.schema:
                kind = str(one.type)
                require("<" not in kind and "binary" not in kind, one.name, kind, "numbers, truths or texts")
        return table.to_pandas()
    return data_in(path, "a table", RunFolderError, read_csv)


def read_csv(text: bytes) -> pd.DataFrame:
    """The table in this text; a single distribution has no difficulty, which is no missing value.

    Raises:
        ValueError: it has too many columns, or is no table.
    """
    if text.partition(b"\n")[0].count(b",") >= MOST_COLUMNS:
        raise ValueError(f"it has more than {MOST_COLUMNS:,} columns")
    return pd.read_csv(BytesIO(text), dtype={"difficulty": str}).fillna({"difficulty": ""})


def select(table: pd.DataFrame, **equal: Any) -> pd.DataFrame:
    """The rows in which each named column has the given value, numbered anew."""
    mask = np.ones(len(table), bool)
    for name, value in equal.items():
        mask &= np.asarray(table[name] == value)
    return cast(pd.DataFrame, table[mask]).reset_index(drop=True)


def keep(table: pd.DataFrame, mask: Any) -> pd.DataFrame:
    """The rows for which ``mask`` [rows] is true, numbered anew."""
    return cast(pd.DataFrame, table.loc[np.asarray(mask, np.bool_)]).reset_index(drop=True)


def pick(table: pd.DataFrame, names: Iterable[str]) -> pd.DataFrame:
    """The columns of these names, in this order."""
    return cast(pd.DataFrame, table[list(names)])


def mean_by(table: pd.DataFrame, by: Sequence[str], values: Iterable[str]) -> pd.DataFrame:
    """One row per combination of the columns ``by``, in their order, with the means of ``values``."""
    return cast(pd.DataFrame, table.groupby(list(by), sort=True, dropna=False)[list(values)].mean()).reset_index()


def binned(frames: Floats) -> Floats:
    """Frames [n], each replaced by the end of its fortieth of the longest run."""
    width = max(frames.max() / CURVE_POINTS, 1.0)
    return np.ceil(frames / width) * width


def count_of(table: pd.DataFrame, name: str) -> int:
    """How many different values a column has."""
    return len(set(table[name]))


def column(table: pd.DataFrame, name: str) -> Floats:
    """A column as float64, NaN where a value is missing; raises :class:`SegarError` where one is no number."""
    try:
        return table[name].to_numpy(dtype=np.float64, na_value=np.nan)
    except (TypeError, ValueError) as error:
        raise SegarError(f"the column '{name}' has values that are no numbers: {error}") from error
