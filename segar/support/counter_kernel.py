"""Counter-based random numbers within compiled kernels: bits that depend on a key and a purpose alone."""

from __future__ import annotations

import math

import numpy as np
from numba import njit

GOLDEN = 0x9E3779B97F4A7C15
SPACING = 2.0**-53

_options = {"nogil": True, "cache": True, "error_model": "numpy", "_nrt": False}


@njit(**_options)
def mix(z):
    """SplitMix64's output function: a well mixed uint64 from a uint64."""
    z = z + np.uint64(GOLDEN)
    z = (z ^ (z >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
    z = (z ^ (z >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
    return z ^ (z >> np.uint64(31))


@njit(**_options)
def uniform(bits):
    """A number uniform in [0, 1) from a well mixed uint64."""
    return np.float64(bits >> np.uint64(11)) * SPACING


@njit(**_options)
def normal(bits):
    """A number from N(0, 1) from a well mixed uint64, by the transform of Box and Muller."""
    radius = math.sqrt(-2.0 * math.log(1.0 - uniform(bits)))
    return radius * math.cos(2.0 * math.pi * uniform(mix(bits)))
