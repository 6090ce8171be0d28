"""Elementary functions on float64 from IEEE operations alone, so that they give the same bits on every processor.

Their errors are a few units in the last place, far below what float32 can hold.
"""

import math

import numpy as np

from segar.support import cached

_options = {"nogil": True, "error_model": "numpy", "_nrt": False}

# Each pair adds up to more digits than a float64 has, and the high part times a small whole number is exact.
LOG_2_HIGH = math.ldexp(round(math.ldexp(math.log(2.0), 32)), -32)
LOG_2_LOW = -4.2009150726810846e-11
QUARTER_HIGH = math.ldexp(round(math.ldexp(math.pi / 2, 32)), -32)
QUARTER_LOW = 6.077100506506192e-11
LARGEST = 708.0  # size of the arguments of exp beyond which results are infinite, or 0, here
SMALL = 0.1  # below it, tanh is a power series
ROOT_2 = 1.4142135623730951


@cached(**_options)
def exp(x):
    """e to the power x."""
    if not x < LARGEST:
        return x + np.inf
    if x < -LARGEST:
        return 0.0
    k = np.int64(x / LOG_2_HIGH + (0.5 if x > 0.0 else -0.5))
    r = (x - k * LOG_2_HIGH) - k * LOG_2_LOW
    term, total = 1.0, 1.0
    for n in range(1, 15):
        term = term * r / n
        total = total + term
    return total * np.int64((k + 1023) << 52).view(np.float64)


@cached(**_options)
def tanh(x):
    """The hyperbolic tangent of x."""
    size = abs(x)
    if size < SMALL:
        s = x * x
        tail = s * (17.0 / 315.0 - s * (62.0 / 2835.0 - s * (1382.0 / 155925.0)))
        return x * (1.0 - s * (1.0 / 3.0 - s * (2.0 / 15.0 - tail)))
    e = exp(-2.0 * size)
    size = (1.0 - e) / (1.0 + e)
    return size if x > 0.0 else -size


@cached(**_options)
def log(x):
    """The natural logarithm of x, a positive normal number."""
    bits = np.float64(x).view(np.int64)
    k = (bits >> 52) - 1023
    m = np.int64((bits & 0xFFFFFFFFFFFFF) | 0x3FF0000000000000).view(np.float64)
    if m > ROOT_2:
        m, k = 0.5 * m, k + 1
    t = (m - 1.0) / (m + 1.0)
    s, total = t * t, 0.0
    for n in range(23, 1, -2):
        total = s * (total + 1.0 / n)
    return k * LOG_2_HIGH + (k * LOG_2_LOW + 2.0 * (t + t * total))


@cached(**_options)
def cos(x):
    """The cosine of x, whose size is below 1e5."""
    k = np.int64(x / QUARTER_HIGH + (0.5 if x > 0.0 else -0.5))
    r = (x - k * QUARTER_HIGH) - k * QUARTER_LOW
    odd = k & 1
    s, total = r * r, 1.0
    for n in range(18 + odd, 1, -2):
        total = 1.0 - s / (n * (n - 1.0)) * total
    value = total * r if odd else total
    return -value if (k + odd) & 2 else value
