"""The compiled kernel of the state observation."""

from __future__ import annotations

from numba import njit

_options = {"nogil": True, "cache": True, "error_model": "numpy", "_nrt": False}


@njit(**_options)
def gather(values, level, rows, types, reads, type_reads, limit, out):
    """Fill ``out[rows]``: entry k is column ``reads[k, 1]`` of slot ``reads[k, 0]``, nan as 0; then the type numbers.

    Where ``reads[k, 3]`` is a column, not -1, the entry is 0 where that column holds false.
    Entry ``type_reads[k, 0]`` is 1 where the type ``type_reads[k, 2]`` fills slot ``type_reads[k, 1]``.
    """
    for row in range(len(rows)):
        env = rows[row]
        for k in range(reads.shape[0]):
            value = values[env, reads[k, 0], reads[k, 1]]
            value = 0.0 if value != value else value
            if reads[k, 3] >= 0 and values[env, reads[k, 0], reads[k, 3]] == 0.0:
                value = 0.0
            value = limit if value > limit else value
            out[env, reads[k, 2]] = -limit if value < -limit else value
        for k in range(type_reads.shape[0]):
            out[env, type_reads[k, 0]] = types[level[env], type_reads[k, 1]] == type_reads[k, 2]
