"""The compiled kernel of solid colours: a pattern of one pixel for each thing, blended by one of its factors."""

from __future__ import annotations

import numpy as np
from numba import njit

_options = {"nogil": True, "cache": True, "error_model": "numpy", "_nrt": False}


@njit(**_options)
def tint_things(values, level, rows, tiles_too, types, is_floor, columns, tints, luma, blends, texels):
    """Colour the things of environments ``rows`` whose blend is another one than ``blends[env, entity]`` says.

    Args:
        columns: int64 ``[type]``, column of the factor that blends; -1 for none.
        tints: float64 ``[type, 3, 3]``: low colour, high colour, and the span of the factor in the third row.
        luma: int64 ``[3]``: weights of red, green and blue in grey, in thousandths; all 0 for RGB frames.
        blends: float64 ``[env, entity]``, nan for what has no colour yet.
        texels: uint8 ``[env, entity, plane, 1, n * texel]``, the patterns.
    """
    for r in range(len(rows)):
        env = rows[r]
        for entity in range(types.shape[1]):
            kind = types[level[env], entity]
            if kind < 0 or (is_floor[kind] and not tiles_too):
                continue
            blend = 0.0
            if columns[kind] >= 0:
                low, high = tints[kind, 2, 0], tints[kind, 2, 1]
                blend = min(max((values[env, entity, columns[kind]] - low) / (high - low), 0.0), 1.0)
            if blend != blends[env, entity]:
                blends[env, entity] = blend
                fill(env, entity, kind, blend, tints, luma, texels)


@njit(**_options)
def fill(env, entity, kind, blend, tints, luma, texels):
    """Make a thing's pattern of one colour."""
    red = np.uint8(np.rint(tints[kind, 0, 0] + blend * (tints[kind, 1, 0] - tints[kind, 0, 0])))
    green = np.uint8(np.rint(tints[kind, 0, 1] + blend * (tints[kind, 1, 1] - tints[kind, 0, 1])))
    blue = np.uint8(np.rint(tints[kind, 0, 2] + blend * (tints[kind, 1, 2] - tints[kind, 0, 2])))
    length = texels.shape[4]
    if luma[1] > 0:
        grey = np.uint8((luma[0] * red + luma[1] * green + luma[2] * blue + 500) // 1000)
        for k in range(length):
            texels[env, entity, 0, 0, k] = grey
    elif texels.shape[2] == 3:
        for k in range(length):
            texels[env, entity, 0, 0, k] = red
            texels[env, entity, 1, 0, k] = green
            texels[env, entity, 2, 0, k] = blue
    else:
        for k in range(0, length, 3):
            texels[env, entity, 0, 0, k] = red
            texels[env, entity, 0, 0, k + 1] = green
            texels[env, entity, 0, 0, k + 2] = blue
