"""The compiled kernel of the state observation."""

from __future__ import annotations

from numba import njit

_options = {"nogil": True, "cache": True, "error_model": "numpy", "_nrt": False}


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
