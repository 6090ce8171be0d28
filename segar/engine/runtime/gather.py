"""Compiled reading of numbers from a batch of states into the rows of a float32 table, for state observations."""

# ruff: noqa: SIM102  numba decides `is not None` at compile time only where it is the whole condition
from typing import NamedTuple

import numpy as np

from segar.support import cached, read_only_view

_options = {"nogil": True, "error_model": "numpy", "_nrt": False}


class Reads(NamedTuple):
    """Arguments of :func:`gather` for a table that shows the numbers of the state unchanged."""

    types: np.ndarray
    reads: np.ndarray
    type_reads: np.ndarray
    missing: float
    limit: float
    parameters: np.ndarray
    parameter_reads: np.ndarray


def no_reads() -> Reads:
    """A table without columns, of the same kinds of arrays as others, so that one kernel serves both."""
    nothing, types, parameters = (np.zeros((0, 0), kind) for kind in (np.int64, np.int16, np.float64))
    return Reads(read_only_view(types), nothing, nothing, 0.0, 0.0, read_only_view(parameters), nothing)


@cached(**_options)
def gather_range(values, level, rows, start, stop, table, out):
    """Fill ``rows[start:stop]`` of ``out``, float32 ``(num_envs, places)``, by :func:`gather`."""
    gather(
        values, level, rows[start:stop], table.types, table.reads, table.type_reads, table.parameters,
        table.parameter_reads, None, None, None, table.missing, table.limit, out, None,
    )  # fmt: skip


@cached(patient=True, **_options)
def gather(
    values, level, rows, types, reads, type_reads, parameters, parameter_reads, seen, shift, scale, missing, limit, out, mask
):  # fmt: skip
    """Fill ``out[rows]`` with numbers of the states, with truths about the types of entities, and with world parameters.

    A number that is nan in the state is missing, and shown as ``missing``; others are shifted, scaled and clipped to
    ``limit``. Where ``seen`` (then no slot is -1), ``shift`` or ``mask`` is None, the kernel is compiled without what
    they are for.

    Args:
        values: float64 ``(num_envs, entities, columns)``; ``level``: int64 ``(num_envs,)``.
        rows: environments, int64 ``(n,)``.
        types: int ``(levels, entities)``, number of each entity's type, -1 for an absent entity.
        reads: int64 ``(k, 5)``: slot (-1: always missing), column, entry of ``out``, a column that hides the number
            where it holds false (-1: none), entry of ``mask``.
        type_reads: int64 ``(k, 4)``: entry of ``out``, slot, type whose presence there is shown, entry of ``mask``.
        parameters: float64 ``(levels, parameters)``.
        parameter_reads: int64 ``(p, 3)``: entry of ``out``, column of ``parameters``, entry of ``mask``.
        seen: bool ``(entities, types)``, whether a type is shown in a slot; the others are missing.
        shift, scale: float ``(k + p,)``, for each of ``reads`` and then of ``parameter_reads``.
        out: float ``(num_envs, places)``; ``mask``: like it, 1 where a number is not missing.
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
        for k in range(parameter_reads.shape[0]):
            value = parameters[level[env], parameter_reads[k, 1]]
            if shift is not None:
                value = (value - shift[reads.shape[0] + k]) * scale[reads.shape[0] + k]
            value = limit if value > limit else value
            out[env, parameter_reads[k, 0]] = -limit if value < -limit else value
            if mask is not None:
                mask[env, parameter_reads[k, 2]] = 1.0
