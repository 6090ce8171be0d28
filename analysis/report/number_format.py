"""Numbers as the report prints them: with signs, p-values, intervals and estimates."""

import math

from analysis.stats.estimate import Estimate

NONE = "–"


def signed(value: float, digits: int = 2) -> str:
    """A number with its sign, a true minus; zero has none."""
    if not math.isfinite(value):
        return NONE
    rounded = round(value, digits) + 0.0
    return f"{rounded:+.{digits}f}".replace("-", "−") if rounded else f"{0:.{digits}f}"


def plain(value: float, digits: int = 2) -> str:
    """A number without a plus; a dash where there is none."""
    return f"{value:.{digits}f}".replace("-", "−") if math.isfinite(value) else NONE


def p_value(p: float) -> str:
    """``0.012``, or ``1.6e-6`` where it is small; a dash where there is none."""
    if not math.isfinite(p):
        return NONE
    if p >= 0.00095 or p == 0:  # what rounds to 0.001
        return f"{p:.3f}" if p else "< 1e-300"
    mantissa, exponent = f"{p:.1e}".split("e")
    return f"{mantissa}e{int(exponent)}"


def interval(found: Estimate, digits: int = 2) -> str:
    """``[−0.79, −0.44]``, or a dash."""
    if not (math.isfinite(found.low) and math.isfinite(found.high)):
        return NONE
    return f"[{signed(found.low, digits)}, {signed(found.high, digits)}]"


def estimate_text(found: Estimate, name: str = "r", digits: int = 2) -> str:
    """``r = −0.65 [−0.79, −0.44], p = 1.6e-6, n = 45``; or why there is no number.

    A correlation without an interval is one of too few blocks, and is not shown: of three points, any is large."""
    is_shown = math.isfinite(found.low) or name.rpartition(" ")[2] != "r"
    if not math.isfinite(found.estimate) or not is_shown:
        return f"no {name}: {found.note}" if found.note else f"no {name}"
    parts = [f"{name} = {signed(found.estimate, digits)}"]
    if math.isfinite(found.low):
        parts[0] += f" {interval(found, digits)}"
    if math.isfinite(found.p):
        shown = p_value(found.p)
        parts.append(f"p {shown}" if shown.startswith("<") else f"p = {shown}")
    return ", ".join([*parts, f"n = {found.n:.0f}"])


def listed(values: object) -> str:
    """Different values in order, with commas."""
    return ", ".join(str(one) for one in sorted(set(values)))  # type: ignore[call-overload]
