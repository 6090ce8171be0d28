"""The compiled kernel of solid colours: a pattern of one pixel for each thing, blended by one of its factors."""

import numpy as np
from numba import njit

from segar.observations.kernel_options import KERNEL_OPTIONS


@njit(**KERNEL_OPTIONS)
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


@njit(**KERNEL_OPTIONS)
def fill(env, entity, kind, blend, tints, luma, texels):
    """Make a thing's pattern of one colour."""
    colour = (blended(tints, kind, 0, blend), blended(tints, kind, 1, blend), blended(tints, kind, 2, blend))
    grey = np.uint8((luma[0] * colour[0] + luma[1] * colour[1] + luma[2] * colour[2] + 500) // 1000)
    for plane in range(texels.shape[2]):
        for k in range(texels.shape[4]):
            channel = plane if texels.shape[2] == 3 else k % 3
            texels[env, entity, plane, 0, k] = grey if luma[1] > 0 else colour[channel]


@njit(**KERNEL_OPTIONS)
def blended(tints, kind, channel, blend):
    """One channel of the colour between the low and the high colour of an entity type, uint8."""
    low, high = tints[kind, 0, channel], tints[kind, 1, channel]
    return np.uint8(np.rint(low + blend * (high - low)))
