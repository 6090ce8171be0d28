"""Compiled functions of one's own, for other targets."""

import math

from numba import njit


@njit(error_model="numpy", _nrt=False)
def doubled(values, rows, scratch, out):
    """Twice a number, by way of scratch."""
    for row in rows:
        scratch[row] = values[row]
    for row in rows:
        out[row] = 2.0 * scratch[row]


@njit(error_model="numpy", _nrt=False)
def foreign(values, rows, out):
    """Calls a function that other targets do not have."""
    for row in rows:
        out[row] = math.lgamma(values[row])
