"""The ledger: threads share one call of a kernel by taking parts of the batch from a counter, without locks.

A ``ledger`` is int64 ``(LEDGER_LENGTH,)``. It holds how many parts are taken, how many are done, how many there are, and
whether the other threads should leave. The owner of a call opens the ledger. The owner and the workers that are in the
kernel take parts until none is left, and the owner returns when all of them are done. A worker that comes late finds no
part and costs nothing.
"""

# pyright: reportCallIssue=false
import numpy as np
from numba import njit, types
from numba.core import cgutils
from numba.extending import intrinsic
from numba.np.arrayobj import make_array

# Each number has a cache line of 8 entries to itself, so that threads that wait for one do not slow the others.
TAKEN, DONE, PARTS, DISMISSED = 0, 8, 16, 24
LEDGER_LENGTH = 32
FROM_THE_END = 1 << 32  # the lower half of TAKEN counts parts from the first on, the upper half parts from the last on
PATIENCE = 400_000  # how often an idle worker reads the ledger before it leaves, some 200 microseconds

_options = {"nogil": True, "error_model": "numpy", "_nrt": False}


def make_ledger(parts: int) -> np.ndarray:
    """A closed ledger of a call that has so many parts."""
    ledger = np.zeros(LEDGER_LENGTH, np.int64)
    ledger[TAKEN] = ledger[DONE] = ledger[PARTS] = parts
    return ledger


@njit(**_options)
def open_ledger(ledger):
    """Let all threads take the parts of a new call."""
    store(ledger, DISMISSED, 0)
    store(ledger, DONE, 0)
    store(ledger, TAKEN, 0)


@njit(**_options)
def take_part(ledger, owns):
    """The number of a part that the caller now has to do. Otherwise -1: to the owner when all parts are done, to a worker
    when it has waited long enough or is dismissed.

    The owner takes parts from the first on, workers from the last on: in the next call, each finds its parts in its cache.
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
    """How many parts are left, given the value of TAKEN."""
    return ledger[PARTS] - taken % FROM_THE_END - taken // FROM_THE_END


@njit(**_options)
def finish_part(ledger):
    """Count a part as done; what the thread wrote for it is visible to the owner from then on."""
    fetch_add(ledger, DONE, 1)


@njit(**_options)
def dismiss(ledger):
    """Make workers that wait for parts leave at once."""
    store(ledger, DISMISSED, 1)


@intrinsic
def load(_context, ledger, index):
    """``ledger[index]``, read so that all that its writer wrote before it is visible."""

    def generate(context, builder, signature, args):
        return builder.load_atomic(_place(context, builder, signature, args), "acquire", 8)

    return types.int64(ledger, index), generate


@intrinsic
def store(_context, ledger, index, value):
    """``ledger[index] = value``, visible to others after all that was written before it."""

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
