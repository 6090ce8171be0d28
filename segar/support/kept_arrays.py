"""Arrays that are handed out, and must stay what they are."""

import numpy as np


def read_only(array: np.ndarray) -> np.ndarray:
    """The same numbers as an array that cannot be written: the array itself where it cannot, else a copy."""
    kept = array.copy() if array.flags.writeable else array
    kept.flags.writeable = False
    return kept


def read_only_view(array: np.ndarray, kind: type | None = None) -> np.ndarray:
    """A contiguous array that cannot be written, on the same memory where it can be: machine code is compiled for each kind of
    array, and this is one for all."""
    view = np.ascontiguousarray(array, kind).view()
    view.flags.writeable = False
    return view
