"""Numbers read out of a batch of states into the rows of a float32 table, compiled: what state observations are."""

# ruff: noqa: SIM102  numba decides `is not None` at compile time only where it stands alone
# pyright: reportCallIssue=false
from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit, types
from numba.extending import intrinsic
from numba.np.arrayobj import make_array, populate_array

_options = {"nogil": True, "cache": True, "error_model": "numpy", "_nrt": False}


class Reads(NamedTuple):
    """What :func:`gather` reads where all that is there is shown as it is: its arguments of these names."""

    types: np.ndarray
    reads: np.ndarray
    type_reads: np.ndarray
    missing: float
    limit: float


def no_reads() -> Reads:
    """A table without columns."""
    nothing = np.zeros((0, 0), np.int64)
    return Reads(nothing, nothing, nothing, 0.0, 0.0)


@njit(**_options)
def gather_range(values, level, rows, start, stop, table, places, address):
    """:func:`gather` for ``rows[start:stop]`` of the table of ``places`` columns that lies at a memory address."""
    out = _table_at(address, len(level), places)
    gather(
        values, level, rows[start:stop], table.types, table.reads, table.type_reads, None, None, None, table.missing,
        table.limit, out, None,
    )  # fmt: skip


@njit(**_options)
def gather(values, level, rows, types, reads, type_reads, seen, shift, scale, missing, limit, out, mask):
    """Fill ``out[rows]``: entry ``reads[k, 2]`` is column ``reads[k, 1]`` of slot ``reads[k, 0]``; then the type numbers.

    What is nan there is missing. So is everything of an entity whose column ``reads[k, 3]``, if it is not -1, holds
    false, of one whose type ``seen[slot, type]`` excludes, and of slot -1. Values are shifted and scaled. Entry
    ``type_reads[k, 0]`` is 1 where the type ``type_reads[k, 2]`` fills slot ``type_reads[k, 1]``. Entries ``reads[k, 4]``
    and ``type_reads[k, 3]`` of ``mask`` are 1 where the number is not missing. Where ``seen`` (then no slot is -1),
    ``shift`` or ``mask`` is None, the kernel is compiled without what they are for.
    """
    for row in range(len(rows)):
        env = rows[row]
        for k in range(reads.shape[0]):
            slot = reads[k, 0]
            value = values[env, slot, reads[k, 1]]
            if reads[k, 3] >= 0 and values[env, slot, reads[k, 3]] == 0.0:
                value = float("nan")
            if seen is not None:
                if slot < 0 or not seen[slot, types[level[env], slot]]:
                    value = float("nan")
            there = value == value
            if shift is not None:
                value = (value - shift[k]) * scale[k]
            value = value if there else missing
            value = limit if value > limit else value
            out[env, reads[k, 2]] = -limit if value < -limit else value
            if mask is not None:
                mask[env, reads[k, 4]] = there
        for k in range(type_reads.shape[0]):
            slot = type_reads[k, 1]
            kind = types[level[env], slot] if slot >= 0 else -1
            out[env, type_reads[k, 0]] = kind == type_reads[k, 2]
            if mask is not None:
                there = kind >= 0
                if seen is not None:
                    there = there and seen[slot, kind]
                mask[env, type_reads[k, 3]] = there


@intrinsic
def _table_at(_context, address, rows, columns):
    """The float32 table, rows one after the other, that lies at a memory address."""
    kind = types.Array(types.float32, 2, "C")

    def generate(context, builder, signature, args):
        address, rows, columns = (
            context.cast(builder, a, t, types.intp) for a, t in zip(args, signature.args, strict=True)
        )
        table = make_array(kind)(context, builder)
        pointer = builder.inttoptr(address, table.data.type)
        size = context.get_constant(types.intp, 4)
        strides = [builder.mul(columns, size), size]
        populate_array(table, pointer, [rows, columns], strides, size, meminfo=None)
        return table._getvalue()

    return kind(address, rows, columns), generate
