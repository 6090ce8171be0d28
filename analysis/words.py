"""Statistics in words, for figures and pages."""

from __future__ import annotations

from analysis.stats.correlation import Correlation, NotAvailable


def in_words(found: Correlation | NotAvailable) -> str:
    """One line: Pearson's r with p, Spearman's rho with p; or why there are none."""
    if isinstance(found, NotAvailable):
        return f"no correlation: {found.reason}"
    pearson = f"r = {signed(found.pearson)} ({p_value(found.pearson_p)})"
    return f"Pearson {pearson}, Spearman ρ = {signed(found.spearman)} ({p_value(found.spearman_p)})"


def in_short(found: Correlation | NotAvailable) -> str:
    """One line: Pearson's r with p and the number of points."""
    if isinstance(found, NotAvailable):
        return f"no r ({found.reason})"
    return f"r = {signed(found.pearson)}, {p_value(found.pearson_p)}, {found.points} runs"


def signed(value: float) -> str:
    """Two decimals with a true minus sign; zero has none."""
    return f"{round(value, 2) + 0.0:+.2f}".replace("-", "−")


def p_value(p: float) -> str:
    """``p = 0.012``, or ``p = 1.5e−5``."""
    return f"p = {number(p)}" if p else "p < 1e−300"


def number(p: float) -> str:
    """Three decimals, or a power of ten where the number is small."""
    if p >= 0.001 or p == 0:
        return f"{p:.3f}"
    mantissa, exponent = f"{p:.1e}".split("e")
    return f"{mantissa}e−{abs(int(exponent))}"
