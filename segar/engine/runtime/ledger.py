"""How threads share one call of a kernel: they take parts of the batch from a counter, without locks or the interpreter.

A ``ledger`` is int64 ``[LEDGER_LENGTH]``: which parts are taken, how many are done, how many there are, and whether
workers are dismissed. The owner of a call opens the ledger; whoever is there takes parts until none is left; the owner
returns when all are done. A worker that comes late finds nothing to take, and one that never comes costs nothing.
"""

# pyright: reportCallIssue=false
from __future__ import annotations

import numpy as np
from numba import njit, types
from numba.core import cgutils
from numba.extending import intrinsic
from numba.np.arrayobj import make_array

TAKEN, DONE, PARTS, DISMISSED = (
    0,
    8,
    16,
    24,
)  # a cache line of 8 numbers each, so that waiting for one does not slow the others
LEDGER_LENGTH = 32
FROM_THE_END = 1 << 32  # parts taken are counted in the lower half from the first, in the upper half from the last
PATIENCE = 400_000  # looks at the ledger before an idle worker gives up, some 200 microseconds

_options = {"nogil": True, "error_model": "numpy", "_nrt": False}


def make_ledger(parts: int) -> np.ndarray:
    """A closed ledger of a call that has so many parts."""
    ledger = np.zeros(LEDGER_LENGTH, np.int64)
    ledger[TAKEN] = ledger[DONE] = ledger[PARTS] = parts
    return ledger


@njit(**_options)
def open_ledger(ledger):
    """Let everyone take the parts of a new call."""
    store(ledger, DISMISSED, 0)
    store(ledger, DONE, 0)
    store(ledger, TAKEN, 0)


@njit(**_options)
def take_part(ledger, owns):
    """The number of a part that is now the caller's; -1 to the owner when all parts are done, to a worker when idle.

    The owner goes up from the first part, workers down from the last: next time each meets what its cache holds.
    """
    for _ in range(PATIENCE):
        if _left(ledger, load(ledger, TAKEN)) > 0:
            taken = fetch_add(ledger, TAKEN, 1 if owns else FROM_THE_END)
            if _left(ledger, taken) > 0:
                return taken % FROM_THE_END if owns else ledger[PARTS] - 1 - taken // FROM_THE_END
        if owns or load(ledger, DISMISSED) != 0:
            break
    while owns and load(ledger, DONE) < ledger[PARTS]:
        pass
    return -1


@njit(**_options)
def _left(ledger, taken):
    return ledger[PARTS] - taken % FROM_THE_END - taken // FROM_THE_END


@njit(**_options)
def finish_part(ledger):
    """Say that a part that was taken is done; what was written for it is visible to the owner."""
    fetch_add(ledger, DONE, 1)


@njit(**_options)
def dismiss(ledger):
    """Let workers that wait for parts give up at once."""
    store(ledger, DISMISSED, 1)


@intrinsic
def load(_context, ledger, index):
    """``ledger[index]``, read after everything that its writer wrote before."""

    def generate(context, builder, signature, args):
        return builder.load_atomic(_place(context, builder, signature, args), "acquire", 8)

    return types.int64(ledger, index), generate


@intrinsic
def store(_context, ledger, index, value):
    """``ledger[index] = value``, seen by others after everything written before."""

    def generate(context, builder, signature, args):
        value = context.cast(builder, args[2], signature.args[2], types.int64)
        builder.store_atomic(value, _place(context, builder, signature, args), "release", 8)
        return context.get_dummy_value()

    return types.void(ledger, index, value), generate


@intrinsic
def fetch_add(_context, ledger, index, amount):
    """``ledger[index]`` before ``amount`` was added to it, both in one indivisible step."""

    def generate(context, builder, signature, args):
        amount = context.cast(builder, args[2], signature.args[2], types.int64)
        return builder.atomic_rmw("add", _place(context, builder, signature, args), amount, "seq_cst")

    return types.int64(ledger, index, amount), generate


def _place(context, builder, signature, args):
    """The address of ``args[1]`` in the one-dimensional array ``args[0]``."""
    array = make_array(signature.args[0])(context, builder, args[0])
    index = context.cast(builder, args[1], signature.args[1], types.intp)
    return cgutils.get_item_pointer(context, builder, signature.args[0], array, [index])
