"""The paper's main question, in numbers: does the gap grow with W2, and is it W2 or merely the number of levels?"""

from __future__ import annotations

from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from analysis.stats.correlation import (
    Correlation,
    Line,
    NotAvailable,
    correlate,
    explained,
    fit_line,
    indicators,
    without_outliers,
)
from analysis.tables import column, select
from analysis.words import signed

Found = Correlation | NotAvailable


def gap_statistics(table: pd.DataFrame, mode: str) -> dict[str, Any]:
    """What the table says of gap against ``w2_<mode>``; one row per run, one action mode.

    ``pooled`` is the paper's test. ``within_panel`` removes differences between (family, difficulty), and
    ``given_panel_and_log_n`` also what the number of levels explains: what is left there is of W2 itself.
    ``without_outliers`` drops points with abs(z) >= 3, as the paper says that it does.
    ``log_w2_explained_by`` is R² of log W2: near 1 means that W2 hardly varies but with panel and n.
    """
    x, y = column(table, f"w2_{mode}"), column(table, "gap")
    panel, log_n = design_matrices(table)
    both = np.column_stack([panel, log_n])
    keep = without_outliers(x, y)
    return {
        "pooled": correlate(x, y),
        "line": fit_line(x, y),
        "within_panel": correlate(x, y, panel),
        "given_panel_and_log_n": correlate(x, y, both),
        "without_outliers": {"removed": int((~keep).sum()), "pooled": correlate(x[keep], y[keep])},
        "panels": {name: correlate(column(part, f"w2_{mode}"), column(part, "gap")) for name, part in by_panel(table)},
        "log_w2_explained_by": log_explained(x, panel, log_n),
    }


def log_n_statistics(table: pd.DataFrame) -> dict[str, Found]:
    """The rival explanation: gap against the logarithm of the number of training levels."""
    panel, log_n = design_matrices(table)
    y = column(table, "gap")
    return {"pooled": correlate(log_n[:, 0], y), "within_panel": correlate(log_n[:, 0], y, panel)}


def log_explained(x: NDArray[np.float64], panel: NDArray[np.float64], log_n: NDArray[np.float64]) -> Any:
    """R² of log ``x`` on panel, on log n, and on both."""
    if not (x > 0).all():
        return NotAvailable("some distances are zero")
    both = np.column_stack([panel, log_n])
    return {name: explained(np.log(x), given) for name, given in (("panel", panel), ("log_n", log_n), ("both", both))}


def design_matrices(table: pd.DataFrame) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Indicators of the panels [runs, panels - 1] and log n [runs, 1]."""
    return indicators(panels(table)), np.log(column(table, "n"))[:, None]


def by_panel(table: pd.DataFrame) -> list[tuple[str, pd.DataFrame]]:
    """(name, rows) of each panel, in the order of the names."""
    named = table.assign(panel=panels(table))
    return [(name, select(named, panel=name)) for name in sorted(set(named["panel"]))]


def panels(table: pd.DataFrame) -> list[str]:
    """Family and difficulty of each row, e.g. ``empty-hard``."""
    return [
        f"{family}-{difficulty}".rstrip("-")
        for family, difficulty in zip(table["family"], table["difficulty"], strict=True)
    ]


def correlation_rows(found: dict[str, Any]) -> list[tuple[str, Found]]:
    """(what is correlated, result) for the correlations of :func:`gap_statistics`, in the order of reading."""
    removed = found["without_outliers"]["removed"]
    outliers = f"{removed} outlier{'' if removed == 1 else 's'}"
    return [
        ("pooled", found["pooled"]),
        (f"pooled without {outliers} (abs(z) ≥ 3)", found["without_outliers"]["pooled"]),
        ("within panels", found["within_panel"]),
        ("given panel and log n", found["given_panel_and_log_n"]),
        *((f"panel {name}", one) for name, one in found["panels"].items()),
    ]


def line_in_words(line: Line | NotAvailable) -> str:
    """The least-squares line as a formula with the slope's 95 % interval."""
    if isinstance(line, NotAvailable):
        return f"no line: {line.reason}"
    return (
        f"gap = {line.intercept:.2f} {'−' if line.slope < 0 else '+'} {abs(line.slope):.2f} W2 "
        f"(95 % interval of the slope {signed(line.slope_low)} to {signed(line.slope_high)}, R² = {line.r_squared:.2f})"
    )
