"""Numbers as the report prints them: with signs, p-values, intervals and estimates."""

import math
from collections.abc import Callable

from segar.analysis.stats.estimate import Estimate

NONE = "–"
NOISE = 1e-12  # a smaller number is the rounding error of a zero
MOST_DIGITS = 6  # behind the point; a smaller number has an exponent


def signed(value: float, digits: int = 2) -> str:
    """A number with its sign, a true minus; zero has none, and only what is zero is written as zero."""
    text = plain(value, digits)
    return f"+{text}" if value >= NOISE else text


def plain(value: float, digits: int = 2) -> str:
    """A number without a plus; a dash where there is none. A number that so many digits would show as zero, and is not, has
    one digit that is not zero."""
    if not math.isfinite(value):
        return NONE
    if abs(value) < NOISE:
        return f"{0:.{digits}f}"
    if is_lost(value, digits):
        digits = first_digit(value)
    size = f"{abs(value):.{digits}f}" if digits <= MOST_DIGITS else with_exponent(abs(value), 0)
    return f"−{size}" if value < 0 else size


def p_value(p: float) -> str:
    """``0.012``, or ``1.6e-6`` where it is small; a dash where there is none."""
    if not math.isfinite(p):
        return NONE
    if p >= 0.00095 or p == 0:  # what rounds to 0.001
        return f"{p:.3f}" if p else "< 1e-300"
    return with_exponent(p, 1)


def with_exponent(value: float, digits: int) -> str:
    """``1.6e-6``."""
    mantissa, exponent = f"{value:.{digits}e}".split("e")
    return f"{mantissa}e{int(exponent)}"


def is_lost(value: float, digits: int) -> bool:
    """Whether so many digits show a number as zero that is not."""
    return abs(value) >= NOISE and not round(value, digits)


def first_digit(value: float) -> int:
    """At which place behind the point a number has its first digit that is not zero."""
    return -math.floor(math.log10(abs(value)))


def digits_of(found: Estimate, digits: int = 2) -> int:
    """How many digits an estimate and its interval are shown with: more than ``digits`` where these would show one of them as
    zero that is not, or the interval without its width. Then half the width has two digits that are not zero."""
    ends = [value for value in (found.estimate, found.low, found.high) if math.isfinite(value)]
    half = (found.high - found.low) / 2 if math.isfinite(found.low + found.high) else 0.0
    is_flat = half >= NOISE and round(found.low, digits) == round(found.high, digits)
    if not is_flat and not any(is_lost(value, digits) for value in ends):
        return digits
    scale = half if half >= NOISE else max(map(abs, ends))
    return min(max(digits, first_digit(scale) + 1), MOST_DIGITS)


def effect(found: Estimate, show: Callable[[float, int], str] = signed) -> tuple[str, str]:
    """``−0.65`` and ``[−0.79, −0.44]``: an estimate, and its interval, or a dash in place of one."""
    digits = digits_of(found)
    ends = f"[{signed(found.low, digits)}, {signed(found.high, digits)}]"
    return show(found.estimate, digits), ends if math.isfinite(found.low + found.high) else NONE


def effect_of_r(found: Estimate) -> tuple[str, str]:
    """:func:`effect` of a correlation, which is not shown where it has no interval: of three points, any is large."""
    return effect(found) if math.isfinite(found.low) else (NONE, NONE)


def with_interval(found: Estimate) -> str:
    """``−0.65 [−0.79, −0.44]``; where there is no interval, the number and why there is none."""
    value, ends = effect(found)
    if ends == NONE:
        return f"{value} ({found.note})" if found.note else value
    return f"{value} {ends}"


def estimate_text(found: Estimate, name: str = "r") -> str:
    """``r = −0.65 [−0.79, −0.44], p = 1.6e-6, n = 45``, without ``r =`` where ``name`` is empty; or why there is no number.

    A correlation is not shown where it has no interval, see :func:`effect_of_r`."""
    is_shown = math.isfinite(found.low) or name.rpartition(" ")[2] != "r"
    if not math.isfinite(found.estimate) or not is_shown:
        return f"no {name or 'number'}" + (f": {found.note}" if found.note else "")
    parts = [f"{name} = {with_interval(found)}" if name else with_interval(found)]
    if math.isfinite(found.p):
        shown = p_value(found.p)
        parts.append(f"p {shown}" if shown.startswith("<") else f"p = {shown}")
    return ", ".join([*parts, f"n = {found.n:.0f}"])


def listed(values: object) -> str:
    """Different values in order, with commas."""
    return ", ".join(str(one) for one in sorted(set(values)))  # type: ignore[call-overload]
