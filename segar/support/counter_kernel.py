"""Random numbers by counting, within compiled kernels: they depend on a key and on their place, and on nothing else.

The bits are those of SplitMix64 (Steele, Lea, Flood 2014).
"""

import math

import numpy as np

from segar.support.compiled import cached
from segar.support.mathematics import cos, log

GOLDEN = 0x9E3779B97F4A7C15
SPACING = 2.0**-53

_options = {"nogil": True, "error_model": "numpy", "_nrt": False}


@cached(**_options)
def scramble(z):
    """SplitMix64's output function without its increment: a well mixed uint64 from a uint64."""
    z = (z ^ (z >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
    z = (z ^ (z >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
    return z ^ (z >> np.uint64(31))


@cached(**_options)
def mix(z):
    """The next number of SplitMix64: a well mixed uint64 from a uint64."""
    return scramble(z + np.uint64(GOLDEN))


@cached(**_options)
def keyed_uniform(key, tick, site, a, b, c):
    """A number uniform in [0, 1), float64: of a rule's draw ``site`` on the entities a, b and c in sub-step ``tick``."""
    z = scramble(np.uint64(key) + np.uint64(tick + 1) * np.uint64(GOLDEN))
    z = scramble(z + np.uint64(site) * np.uint64(0xD1B54A32D192ED03))
    z = scramble(z + np.uint64(a * 65536 + b) * np.uint64(0x8CB92BA72F3D8DD7) + np.uint64(c))
    return uniform(z)


@cached(**_options)
def uniform(bits):
    """A number uniform in [0, 1) from a well mixed uint64."""
    return np.float64(bits >> np.uint64(11)) * SPACING


@cached(**_options)
def normal(bits):
    """A number from N(0, 1) from a well mixed uint64, by the transform of Box and Muller."""
    radius = math.sqrt(-2.0 * log(1.0 - uniform(bits)))
    return radius * cos(2.0 * math.pi * uniform(mix(bits)))
