"""Elementary functions of float64 within compiled kernels, with the same bits on every processor.

They consist of sums, products, quotients and square roots of float64, comparisons and whole numbers. IEEE 754 says
what these are, to the bit, so neither a C library nor the kind of processor matters. Angles are in radians. Special
cases are those of C99, annex F. ``docs/reference/mathematics.md`` has the errors.

The methods are known ones: tables and short polynomials (Tang 1989, 1990), subtraction of multiples in parts (Cody and
Waite 1980), 2 / pi in whole numbers for large angles (Payne and Hanek 1983), products and quotients in two parts
(Dekker 1971). :mod:`benchmarks.mathematics_tables` derives all constants, and compares the tables.
"""

import math

import numpy as np

from segar.support.compiled import cached

# isort: off
from segar.support.mathematics_constants import (
    ATAN_0, ATAN_1, ATAN_2, ATAN_3, ATAN_4, ATAN_5, ATAN_6, COS_0, COS_1, COS_2, COS_3, COS_4, COS_5, EXP_0, EXP_1,
    EXP_2, EXP_3, EXP_INVERSE, EXP_STEP_HIGH, EXP_STEP_LOW, LN2_HIGH, LN2_LOW, LOG_0, LOG_1, LOG_2, LOG_3, LOG_4,
    PI_2_A, PI_2_B, PI_2_C, PI_2_HIGH, PI_2_LOW, POW_0, POW_1, POW_2, POW_3, POW_4, POW_5, SIN_0, SIN_1, SIN_2,
    SIN_3, SIN_4, SIN_5, SIN_6, SIN_START, TANH_0, TANH_1, TANH_2, TANH_3, TANH_4, TANH_5, TANH_6, TANH_7,
    TAN_ABOVE_1, TAN_ABOVE_2, TAN_ABOVE_3, TAN_ABOVE_4, TAN_BELOW_2, TAN_BELOW_3, TAN_BELOW_4, TWO_OVER_PI,
    TWO_OVER_PI_LIMBS,
)  # fmt: skip

# isort: on
from segar.support.mathematics_tables import ATAN_TABLE, EXP_TABLE, LOG_TABLE

__all__ = ["arctan2", "cos", "exp", "hypot", "log", "pow", "sin", "tan", "tanh"]

# Of the files of constants and tables, so that kernels which contain them are others if they change.
CONSTANTS = "3a949153"

_options = {"nogil": True, "error_model": "numpy", "_nrt": False}
_fast = cached(**_options, forceinline=True)  # what usual arguments take; small, and part of the caller
_rare = cached(**_options)  # what the others take

SIGN = np.int64(-(2**63))
NORMAL = 0x0010000000000000  # bits of the smallest normal number
INFINITE = 0x7FF0000000000000  # bits of infinity
UPPER = np.int64(-(2**27))  # mask of 26 significant bits, whose products are exact
SHORT = np.int64(-(2**37))  # mask of 16 significant bits, whose cubes are exact
ROUND = 1.5 * 2.0**52  # added and subtracted, it rounds to a whole number, which the lowest bits of the sum hold

EXP_LIMIT = 690.0  # up to here the result and the smallest of its parts are normal
LOG_FIRST = 0x3FE6A80000000000  # bits of the first number of the first cell of the table
SMALL_ANGLE = 2.0**-28  # below, sin x = tan x = x
LARGE_ANGLE = 2.0**17  # from here on the multiples of the parts of pi / 2 would not be exact


# -- exp, log, pow -------------------------------------------------------------------------------------------------


@_fast
def exp(x):
    """The exponential e^x."""
    x = np.float64(x)
    if abs(x) < EXP_LIMIT:
        steps, r = _steps(x)
        scale, part = _power(steps, r)
        return scale + scale * part
    return _exp_of_large(x)


@_fast
def log(x):
    """The natural logarithm; -inf at zero, nan below."""
    x = np.float64(x)
    bits = _bits(x)
    if not _is_normal(bits):
        return _log_of_rare(x)
    high, r, low = _log_parts(bits, 0)
    return high + _log_rest(r, low)


@_fast
def pow(x, y):
    """The power x^y; nan if x is negative and y is not whole."""
    x, y = np.float64(x), np.float64(y)
    bits = _bits(x)
    if _is_normal(bits):
        high, low = _scaled_log(bits, 0, y)
        if abs(high) < EXP_LIMIT:
            steps, r = _steps(high)
            scale, part = _power(steps, r + low)
            return scale + scale * part
    return _pow_of_rare(x, y)


@_fast
def _steps(x):
    """x in whole steps of log(2) / 128, as the lowest bits of the first result, and the rest."""
    rounded = x * EXP_INVERSE + ROUND
    k = rounded - ROUND
    return _bits(rounded), (x - k * EXP_STEP_HIGH) - k * EXP_STEP_LOW


@_fast
def _power(steps, r):
    """e^(r + steps log(2) / 128) as scale (1 + part), where scale is a float near it."""
    at = (steps & 127) << 1
    scale = _float(_bits(EXP_TABLE[at]) + ((steps & -128) << 45))
    return scale, _exp_rest(r, EXP_TABLE[at + 1])


@_fast
def _exp_rest(r, tail):
    """e^r - 1 + tail."""
    r2 = r * r
    return ((tail + r) + r2 * (EXP_0 + r * EXP_1)) + (r2 * r2) * (EXP_2 + r * EXP_3)


@_fast
def _log_parts(bits, k):
    """log(z) + k log(2) as a sum: high + low + log1p(r) - r, of which high already contains r; z has these bits."""
    above = bits - LOG_FIRST
    at = (above >> 42) & (255 << 2)
    k += above >> 52
    bits -= above & -(1 << 52)
    z, upper = _float(bits), _float(bits & UPPER)
    inverse = LOG_TABLE[at]
    r = (upper * inverse - 1.0) + (z - upper) * inverse  # exact, for the inverse has 9 bits
    octaves = np.float64(k)
    start = octaves * LN2_HIGH + LOG_TABLE[at + 1]  # exact
    high = start + r
    return high, r, ((start - high) + r) + (octaves * LN2_LOW + LOG_TABLE[at + 2])


@_fast
def _log_rest(r, low):
    """low + log1p(r) - r."""
    r2 = r * r
    r4 = r2 * r2
    return (low + r2 * (r * LOG_0 - 0.5)) + r4 * ((LOG_1 + r * LOG_2) + r2 * (LOG_3 + r * LOG_4))


@_fast
def _scaled_log(bits, k, y):
    """y (log(z) + k log(2)) in two parts, where z has these bits."""
    high, r, low = _log_parts(bits, k)
    r2, third = r * r, r * POW_0
    # 26 bits of the logarithm are enough in front; what they lack joins the rest.
    upper, y_upper = _upper(high + r2 * (third - 0.5)), _upper(y)
    a = _upper(r)
    half = 0.5 * a
    square = half * a  # exact
    value = high - square
    rest = (r2 * r2) * ((POW_1 + r * POW_2) + r2 * ((POW_3 + r * POW_4) + r2 * POW_5)) + (
        r2 * third - (r - a) * (half + 0.5 * r)
    )
    lower = (value - upper) + ((low + ((high - value) - square)) + rest)
    return y_upper * upper, y * lower + (y - y_upper) * upper


@_rare
def _exp_of_large(x):
    if x > 710.0:
        return np.inf
    if x < -746.0:
        return 0.0
    if x != x:
        return x
    steps, r = _steps(x)
    return _far_power(steps, r)


@_rare
def _far_power(steps, r):
    """e^(r + steps log(2) / 128), rounded once where it is subnormal, infinite where it is too large."""
    if _float(np.int64(steps)) > ROUND:
        scale, part = _power(steps - 128 * 4, r)
        return (scale + scale * part) * 16.0
    scale, part = _power(steps + 128 * 100, r)
    grid = 2.0**-922  # its spacing is 2^100 times that of subnormal numbers
    product = scale * part
    y = scale + product
    if y < grid:
        rest = (scale - y) + product
        high = grid + y
        y = (high + (((grid - high) + y) + rest)) - grid
    return y * 2.0**-100


@_rare
def _log_of_rare(x):
    if x == 0.0:
        return -np.inf
    if x < 0.0:
        return np.nan
    if not x < np.inf:
        return x
    high, r, low = _log_parts(_bits(x * 2.0**54), -54)
    return high + _log_rest(r, low)


@_rare
def _pow_of_rare(x, y):
    if y == 0.0 or x == 1.0:
        return 1.0
    if x != x or y != y:
        return x + y
    whole, odd = _is_whole(y), _is_odd(y)
    sign = -1.0 if odd and _bits(x) < 0 else 1.0
    size = abs(x)
    if size == 0.0 or size == np.inf:
        return sign * (np.inf if (size == 0.0) == (y < 0.0) else 0.0)
    if abs(y) == np.inf:
        if size == 1.0:
            return 1.0
        return np.inf if (size > 1.0) == (y > 0.0) else 0.0
    if x < 0.0 and not whole:
        return np.nan
    high, low = (
        _scaled_log(_bits(size), 0, y) if _is_normal(_bits(size)) else _scaled_log(_bits(size * 2.0**54), -54, y)
    )
    if high > 710.0:
        return sign * np.inf
    if high < -746.0:
        return sign * 0.0
    steps, r = _steps(high)
    return sign * _far_power(steps, r + low)


@_rare
def _is_whole(y):
    return abs(y) >= 2.0**52 or (abs(y) + 2.0**52) - 2.0**52 == abs(y)


@_rare
def _is_odd(y):
    return abs(y) < 2.0**53 and _is_whole(y) and not _is_whole(0.5 * y)


# -- sin, cos, tan -------------------------------------------------------------------------------------------------


@_fast
def sin(x):
    """The sine of x."""
    x = np.float64(x)
    if SMALL_ANGLE <= abs(x) < LARGE_ANGLE:
        quarter, r, low, certain = _reduced(x)
        if certain:
            return _sine_at(quarter, r, low)
    return _sin_of_rare(x)


@_fast
def cos(x):
    """The cosine of x."""
    x = np.float64(x)
    if abs(x) < LARGE_ANGLE:
        quarter, r, low, certain = _reduced(x)
        if certain:
            return _sine_at(quarter + 1, r, low)
    return _cos_of_rare(x)


@_fast
def tan(x):
    """The tangent of x."""
    x = np.float64(x)
    if SMALL_ANGLE <= abs(x) < LARGE_ANGLE:
        quarter, r, low, certain = _reduced(x)
        if certain:
            return _tangent_at(quarter, r, low)
    return _tan_of_rare(x)


@_fast
def _reduced(x):
    """The number of right angles in x, as the lowest bits of the first result, the rest in two parts, and whether these are
    enough, which they are not if the rest is almost zero."""
    rounded = x * TWO_OVER_PI + ROUND
    k = rounded - ROUND
    left = x - k * PI_2_A  # exact
    b = k * PI_2_B
    r = left - b
    low = ((left - r) - b) - k * PI_2_C
    return _bits(rounded), r, low, abs(r) >= abs(k) * 2.0**-64


@_fast
def _sine_at(quarter, r, low):
    """sin(r + low + quarter pi / 2) for r in [-pi / 4, pi / 4]."""
    z = r * r
    z2 = z * z
    z4 = z2 * z2
    a = _float(_bits(r) & SHORT)
    behind, half = r - a, 0.5 * a
    # Of 1 - z / 2 and of r - 5 z r / 32 the parts with a are exact.
    half_square, cube = half * a, (a * SIN_START) * (a * a)
    flat, steep = 1.0 - half_square, r + cube
    p = ((COS_0 + z * COS_1) + z2 * (COS_2 + z * COS_3)) + z4 * (COS_4 + z * COS_5)
    cosine = flat + (((1.0 - flat) - half_square) + (z2 * p - (behind * (half + 0.5 * r) + r * low)))
    p = ((SIN_0 + z * SIN_1) + z2 * (SIN_2 + z * SIN_3)) + z4 * ((SIN_4 + z * SIN_5) + z2 * SIN_6)
    rest = (SIN_START * behind) * (z + a * (r + a)) + low * flat
    sine = steep + (((r - steep) + cube) + ((r * z) * p + rest))
    value = _chosen(cosine, sine, -(quarter & 1))
    return _float(_bits(value) ^ ((quarter & 2) << 62))


@_fast
def _tangent_at(quarter, r, low):
    """tan(r + low + quarter pi / 2) for r in [-pi / 4, pi / 4], as a quotient of what is almost the sine and the cosine."""
    odd = -(quarter & 1)
    z = r * r
    z2 = z * z
    p = (TAN_ABOVE_1 + z * TAN_ABOVE_2) + z2 * (TAN_ABOVE_3 + z * TAN_ABOVE_4)
    sine_rest = (r * z) * p + (low - low * (0.5 * z))
    a = _upper(r)
    half = 0.5 * a
    half_square = half * a  # exact
    start = 1.0 - half_square
    p = (TAN_BELOW_2 + z * TAN_BELOW_3) + z2 * TAN_BELOW_4
    cosine_rest = ((1.0 - start) - half_square) + (z2 * p - ((r - a) * (half + 0.5 * r) + r * low))
    sine, cosine = r + sine_rest, start + cosine_rest
    sine_low, cosine_low = (r - sine) + sine_rest, (start - cosine) + cosine_rest
    n, n_low = _chosen(-cosine, sine, odd), _chosen(-cosine_low, sine_low, odd)
    _, value, rest = _quotient(n, n_low, _chosen(sine, cosine, odd), _chosen(sine_low, cosine_low, odd))
    return value + rest


@_fast
def _quotient(n, n_low, d, d_low):
    """(n + n_low) / (d + d_low), and the same in two parts, of which the first has 26 bits."""
    inverse = 1.0 / d
    q = n * inverse
    a, b = _upper(q), _upper(d)
    missing = (n - a * b) + (n_low - a * (d_low + (d - b)))  # a b is exact
    return q, a, missing * inverse


@_rare
def _sin_of_rare(x):
    if abs(x) < SMALL_ANGLE:
        return x
    if not abs(x) < np.inf:
        return x - x
    quarter, r, low = _reduced_large(x)
    return _sine_at(quarter, r, low)


@_rare
def _cos_of_rare(x):
    if not abs(x) < np.inf:
        return x - x
    quarter, r, low = _reduced_large(x)
    return _sine_at(quarter + 1, r, low)


@_rare
def _tan_of_rare(x):
    if abs(x) < SMALL_ANGLE:
        return x
    if not abs(x) < np.inf:
        return x - x
    quarter, r, low = _reduced_large(x)
    return _tangent_at(quarter, r, low)


@_rare
def _reduced_large(x):
    """The number of right angles in x, from 16 on, and the rest in two parts, from as many bits of 2 / pi as are needed."""
    bits = _bits(x)
    m = np.uint64((bits & (2**52 - 1)) | 2**52)
    exponent = ((bits >> 52) & 0x7FF) - 1075  # |x| = m 2^exponent
    # Bits of 2 / pi in front of these make whole turns; the table begins with 64 zeros.
    at = exponent + 62
    middle, last = _bits_of_quotient(at + 64), _bits_of_quotient(at + 128)
    p2, p1, p0 = m * last, m * middle, m * _bits_of_quotient(at)  # of the product's 192 bits, the last 64 first
    before, p1 = p1, p1 + _upper_product(m, last)
    p0 += _upper_product(m, middle) + np.uint64(p1 < before)
    # Two bits count right angles, and the rest is a fraction of one, here from -1/2 to 1/2.
    quarter = np.int64(p0 >> np.uint64(62))
    p0, p1, p2 = _shifted(p0, p1, p2, 2)
    negative = p0 >> np.uint64(63) != np.uint64(0)
    if negative:
        quarter += 1
        p0, p1, p2 = ~p0, ~p1, ~p2
    scale = 1.0
    while p0 >> np.uint64(63) == np.uint64(0):
        p0, p1, p2 = _shifted(p0, p1, p2, 1)
        scale *= 0.5
    high = np.float64(p0 >> np.uint64(11)) * 2.0**-53
    low = np.float64(((p0 & np.uint64(2047)) << np.uint64(42)) | (p1 >> np.uint64(22))) * 2.0**-106
    r = high * PI_2_HIGH
    a, b = _upper(high), _upper(PI_2_HIGH)
    rest = ((a * b - r) + (a * (PI_2_HIGH - b) + (high - a) * b)) + (high - a) * (PI_2_HIGH - b)
    rest += high * PI_2_LOW + low * PI_2_HIGH
    if negative != (bits < 0):
        scale = -scale
    return -quarter if bits < 0 else quarter, r * scale, rest * scale


@_rare
def _bits_of_quotient(at):
    """64 bits of 2 / pi."""
    limb, shift, half = at >> 5, np.uint64(at & 31), np.uint64(32)
    bits = (TWO_OVER_PI_LIMBS[limb] << half) | TWO_OVER_PI_LIMBS[limb + 1]
    return (bits << shift) | (TWO_OVER_PI_LIMBS[limb + 2] >> (half - shift))


@_rare
def _upper_product(a, b):
    """The upper 64 bits of a product of two uint64."""
    word, half = np.uint64(0xFFFFFFFF), np.uint64(32)
    first = (a >> half) * (b & word) + (((a & word) * (b & word)) >> half)
    second = (a & word) * (b >> half) + (first & word)
    return (a >> half) * (b >> half) + (first >> half) + (second >> half)


@_rare
def _shifted(p0, p1, p2, n):
    """192 bits, shifted left."""
    left, right = np.uint64(n), np.uint64(64 - n)
    return (p0 << left) | (p1 >> right), (p1 << left) | (p2 >> right), p2 << left


# -- tanh, arctan2, hypot ------------------------------------------------------------------------------------------


@_fast
def tanh(x):
    """The hyperbolic tangent of x."""
    x = np.float64(x)
    size = abs(x)
    if size < 0.25:
        z = size * size
        z2 = z * z
        low = (TANH_0 + z * TANH_1) + z2 * (TANH_2 + z * TANH_3)
        high = (TANH_4 + z * TANH_5) + z2 * (TANH_6 + z * TANH_7)
        value = size + (size * z) * (low + (z2 * z2) * high)
    elif size < 20.0:
        # 1 - 2 / (e^2x + 1), in two parts throughout
        steps, r = _steps(2.0 * size)
        scale, part = _power(steps, r)
        product = scale * part
        e = scale + product
        d = e + 1.0
        _, q, rest = _quotient(2.0, 0.0, d, ((e - d) + 1.0) + ((scale - e) + product))
        value = 1.0 - q
        value += ((1.0 - value) - q) - rest
    else:
        value = 1.0 if size == size else size
    return _float(_bits(value) | (_bits(x) & SIGN))


@_fast
def arctan2(y, x):
    """The angle of the point (x, y), in [-pi, pi]."""
    y, x = np.float64(y), np.float64(x)
    if _is_near(abs(y), abs(x)):
        return _angle(y, x)
    return _angle_of_rare(y, x)


@_fast
def _is_near(a, b):
    """Whether two sizes are so near each other, and to one, that their products and quotients are normal."""
    return 2.0**-900 < a < 2.0**900 and b * 2.0**-50 < a and a * 2.0**-50 < b


@_fast
def _angle(y, x):
    """The angle of the point (x, y), by the quotient of the smaller and the larger coordinate, less a multiple of 1 / 4."""
    x_size, y_size = abs(x), abs(y)
    a, b = (x_size, y_size) if x_size < y_size else (y_size, x_size)
    steep, back = np.int64(y_size > x_size), (_bits(x) >> 63) & 1
    turn = (steep ^ back) << 63  # the angle decreases as the quotient grows
    first, second = 0.25 if a > 0.125 * b else 0.0, 0.25 if a > 0.375 * b else 0.0
    third, fourth = 0.25 if a > 0.625 * b else 0.0, 0.25 if a > 0.875 * b else 0.0
    c = (first + second) + (third + fourth)
    # atan(a / b) = atan(c) + atan((a - c b) / (b + c a))
    b_upper, a_upper = _upper(b), _upper(a)
    n_start, n_rest = a - c * b_upper, c * (b - b_upper)  # exact
    n = n_start - n_rest
    d = b + c * a
    d_low = ((b - d) + c * a_upper) + c * (a - a_upper)
    n_low = (n_start - n) - n_rest
    u, u_upper, u_low = _quotient(_float(_bits(n) ^ turn), _float(_bits(n_low) ^ turn), d, d_low)
    z = u * u
    z2 = z * z
    p = ((ATAN_0 + z * ATAN_1) + z2 * (ATAN_2 + z * ATAN_3)) + (z2 * z2) * ((ATAN_4 + z * ATAN_5) + z2 * ATAN_6)
    place = ((steep + 2 * back) << 4) + ((_bits(c + 0.25 * ROUND) & 7) << 1)
    start = ATAN_TABLE[place]
    high = start + u_upper
    value = high + ((((start - high) + u_upper) + (ATAN_TABLE[place + 1] + u_low)) + (u * z) * p)
    return _float(_bits(value) | (_bits(y) & SIGN))


@_rare
def _angle_of_rare(y, x):
    if x != x or y != y:
        return x + y
    a, b, sign = abs(y), abs(x), _bits(y) & SIGN
    forward = _bits(x) >= 0
    if a == b:  # both zero, or infinite; otherwise they are too large or too small for their products
        a = b = 0.0 if a == 0.0 else 1.0
    if a == 0.0 or a <= b * 2.0**-50:
        value = 0.0 if a == 0.0 or b == np.inf else a / b
        value = value if forward else 2.0 * PI_2_HIGH + (2.0 * PI_2_LOW - value)
    elif b <= a * 2.0**-50:
        value = 0.0 if b == 0.0 or a == np.inf else b / a
        value = PI_2_HIGH + (PI_2_LOW - value if forward else PI_2_LOW + value)
    else:
        scale = 1.0 if a == 1.0 else (2.0**-600 if a > 1.0 else 2.0**600)
        value = _angle(a * scale, math.copysign(b * scale, x))
    return _float(_bits(value) | sign)


@_fast
def hypot(x, y):
    """The length of the vector (x, y)."""
    x, y = abs(np.float64(x)), abs(np.float64(y))
    if 2.0**-400 < x + y < 2.0**500:
        return _length(x, y)
    return _length_of_rare(x, y)


@_fast
def _length(x, y):
    x_bits, y_bits = _bits(x), _bits(y)
    swap = (x_bits ^ y_bits) & -np.int64(y_bits > x_bits)
    a, b = _float(x_bits ^ swap), _float(y_bits ^ swap)  # a >= b
    a_upper, b_upper = _upper(a), _upper(b)
    a_square, b_square = a_upper * a_upper, b_upper * b_upper  # exact
    high = a_square + b_square
    low = ((a_square - high) + b_square) + ((a - a_upper) * (a + a_upper) + (b - b_upper) * (b + b_upper))
    return math.sqrt(high + low)


@_rare
def _length_of_rare(x, y):
    if x == np.inf or y == np.inf:
        return np.inf
    if x != x or y != y:
        return x + y
    if x + y > 1.0:
        return _length(x * 2.0**-600, y * 2.0**-600) * 2.0**600
    return _length(x * 2.0**600, y * 2.0**600) * 2.0**-600


# -- bits ----------------------------------------------------------------------------------------------------------


@_fast
def _bits(x):
    """The bits of a float64 as an int64."""
    return np.float64(x).view(np.int64)


@_fast
def _float(bits):
    """The float64 that has these bits."""
    return np.int64(bits).view(np.float64)


@_fast
def _upper(x):
    """x with only its first 26 significant bits."""
    return _float(_bits(x) & UPPER)


@_fast
def _chosen(a, b, mask):
    """a where all bits of the mask are set, b where none is; a branch could not be predicted."""
    return _float(_bits(b) ^ ((_bits(a) ^ _bits(b)) & mask))


@_fast
def _is_normal(bits):
    """Whether these are the bits of a positive, normal, finite number."""
    return NORMAL <= bits < INFINITE
