"""The compiled kernel of textures: from the factors of things to their patterns, as ``TextureSet.patches`` defines them."""

import math
from typing import NamedTuple

import numpy as np
from numba import njit

from segar.observations.kernel_options import KERNEL_OPTIONS
from segar.support import GOLDEN, mix, normal, uniform
from segar.textures import NOISE_CLIP


class Loom(NamedTuple):
    """What the kernels know of a set of textures and of the entity types that they show.

    ``types``, ``is_floor``: as in :class:`segar.observations.pixels.pixel_kernel.FrameGeometry`; ``columns``, ``constants``,
    ``noise``: as in :class:`segar.textures.TypeInputs`; the others as in :class:`segar.textures.TextureSet`, in float64.
    """

    types: np.ndarray
    is_floor: np.ndarray
    columns: np.ndarray
    constants: np.ndarray
    noise: np.ndarray
    shift: np.ndarray
    scale: np.ndarray
    weights: np.ndarray
    """``[model, input, P * P * 3]``"""
    bias: np.ndarray
    """``[model, P * P * 3]``"""
    bends: bool
    """Whether the squash is tanh; else it clips."""
    luma: np.ndarray
    """int64 ``[3]``, weights of red, green and blue in grey, in thousandths; all 0 for RGB frames."""


@njit(**KERNEL_OPTIONS)
def draw_noise(key, rows, noise):
    """Fill ``noise[rows]``, float64 ``[env, entity, draw]``, from N(0, 1), clipped; each by its key, entity and number."""
    for r in range(len(rows)):
        env = rows[r]
        for entity in range(noise.shape[1]):
            bits = mix(key[r] + np.uint64(entity + 1) * np.uint64(GOLDEN))
            for draw in range(noise.shape[2]):
                bits = mix(bits + np.uint64(GOLDEN))
                noise[env, entity, draw] = min(max(normal(bits), -NOISE_CLIP), NOISE_CLIP)


@njit(**KERNEL_OPTIONS)
def draw_models(key, rows, count, model):
    """Fill ``model[rows]`` with whole numbers below ``count``, each by its key."""
    for r in range(len(rows)):
        model[rows[r]] = np.int64(uniform(mix(key[r])) * count)


@njit(**KERNEL_OPTIONS)
def read_features(values, level, rows, loom, noise, features):
    """Fill ``features[rows]``, float64 ``[env, entity, input]``."""
    for r in range(len(rows)):
        env = rows[r]
        for entity in range(loom.types.shape[1]):
            kind = loom.types[level[env], entity]
            if kind >= 0:
                for i in range(features.shape[2]):
                    features[env, entity, i] = feature(values, env, entity, kind, i, loom, noise)


@njit(**KERNEL_OPTIONS)
def weave_things(level, rows, loom, model, features, raw, texels):
    """Make the patterns of all things of environments ``rows`` from their features; ``raw``: float64 ``[P * P * 3]``."""
    for r in range(len(rows)):
        env = rows[r]
        for entity in range(loom.types.shape[1]):
            if loom.types[level[env], entity] >= 0:
                weave(env, entity, loom, model[env], features, raw, texels)


@njit(**KERNEL_OPTIONS)
def follow_changes(values, level, rows, loom, model, noise, features, raw, texels):
    """Make anew the patterns of objects whose features have changed."""
    for r in range(len(rows)):
        env = rows[r]
        for entity in range(loom.types.shape[1]):
            kind = loom.types[level[env], entity]
            if kind < 0 or loom.is_floor[kind]:
                continue
            changed = False
            for i in range(features.shape[2]):
                now = feature(values, env, entity, kind, i, loom, noise)
                changed |= now != features[env, entity, i]
                features[env, entity, i] = now
            if changed:
                weave(env, entity, loom, model[env], features, raw, texels)


@njit(**KERNEL_OPTIONS)
def feature(values, env, entity, kind, i, loom, noise):
    """The feature of input i for an entity of type ``kind``."""
    if loom.noise[i] >= 0:
        return noise[env, entity, loom.noise[i]] * loom.scale[i]
    if loom.columns[kind, i] < 0:
        return loom.constants[kind, i]
    value = (values[env, entity, loom.columns[kind, i]] - loom.shift[i]) * loom.scale[i]
    return value if math.isfinite(value) else 0.0


@njit(**KERNEL_OPTIONS)
def weave(env, entity, loom, model, features, raw, texels):
    """Make one thing's pattern: one period from its features, repeated to the end of each row."""
    for k in range(len(raw)):
        raw[k] = loom.bias[model, k]
    for i in range(features.shape[2]):
        f = features[env, entity, i]
        if f != 0.0:
            for k in range(len(raw)):
                raw[k] += f * loom.weights[model, i, k]
    for k in range(len(raw)):
        y = math.tanh(raw[k]) if loom.bends else min(max(raw[k], -1.0), 1.0)
        raw[k] = np.floor(255.0 * (y + 1.0) / 2.0)
    period, planes = texels.shape[3], texels.shape[2]
    for row in range(period):
        for column in range(period):
            at = (row * period + column) * 3
            if loom.luma[1] > 0:
                texels[env, entity, 0, row, column] = luma_of(raw, at, loom.luma)
            else:
                for c in range(3):
                    plane, to = (c, column) if planes == 3 else (0, 3 * column + c)
                    texels[env, entity, plane, row, to] = np.uint8(raw[at + c])
    back = period if planes == 3 or loom.luma[1] > 0 else 3 * period
    for plane in range(planes):
        for row in range(period):
            for k in range(back, texels.shape[4]):
                texels[env, entity, plane, row, k] = texels[env, entity, plane, row, k - back]


@njit(**KERNEL_OPTIONS)
def luma_of(raw, at, luma):
    """The grey of three numbers from 0 to 255, as :func:`segar.observations.pixels.canvas.grey_of` rounds it."""
    total = luma[0] * int(raw[at]) + luma[1] * int(raw[at + 1]) + luma[2] * int(raw[at + 2])
    return np.uint8((total + 500) // 1000)
