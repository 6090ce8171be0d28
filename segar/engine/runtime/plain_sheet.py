"""Plain twin of :mod:`segar.engine.runtime.sheet`: the sheet is the table itself, and one thread makes each call."""

import numpy as np
from numba import njit

_options = {"nogil": True, "error_model": "numpy", "_nrt": False}


def make_sheet() -> np.ndarray:
    """A table without rows."""
    return np.zeros((0, 0), np.float32)


def sheet_with(sheet: np.ndarray, table: np.ndarray) -> np.ndarray:
    """The table, float32 ``(num_envs, ...)``, as float32 ``(num_envs, places)``."""
    return table.reshape(len(table), -1)


@njit(**_options)
def table_on(sheet, rows, columns):
    """The table itself."""
    return sheet
