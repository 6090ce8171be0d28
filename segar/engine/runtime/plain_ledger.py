"""Plain twin of :mod:`segar.engine.runtime.ledger`: the owner of a call takes all parts, one after the other."""

import numpy as np
from numba import njit

TAKEN, PARTS = 0, 1

_options = {"nogil": True, "error_model": "numpy", "_nrt": False}


def make_ledger(parts: int) -> np.ndarray:
    """A ledger of a call that has so many parts; int64 ``(2,)``."""
    return np.array([parts, parts])


@njit(**_options)
def open_ledger(ledger):
    """Let the owner take the parts of a new call."""
    ledger[TAKEN] = 0


@njit(**_options)
def take_part(ledger, owns):
    """The number of the owner's next part; -1 when there is none, and always -1 for other threads."""
    if not owns or ledger[TAKEN] == ledger[PARTS]:
        return -1
    ledger[TAKEN] += 1
    return ledger[TAKEN] - 1


@njit(**_options)
def finish_part(ledger):
    """Do nothing: what the owner takes, it finishes itself."""


@njit(**_options)
def dismiss(ledger):
    """Do nothing: no other thread waits."""
