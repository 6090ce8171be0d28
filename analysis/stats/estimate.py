"""A number with what it takes to judge it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, fields, replace
from typing import Any

import numpy as np
from scipy import stats

from segar.analysis.tables import Floats

ROUNDING = 1e-12  # width of an interval, as a part of its ends, that is none
ALIKE = "all units are alike: no interval"
NOT_FINITE = "some values are missing or not finite"


@dataclass(frozen=True)
class Estimate:
    """An estimate, its confidence interval, what it rests on, and how probable it is where there is nothing.

    What cannot be had is NaN, and ``note`` says why.
    """

    estimate: float
    low: float
    high: float
    n: int  # independent units: runs, clusters, replicates or episodes, as the function says that made it
    p: float = float("nan")  # two-sided, unless the function says otherwise
    level: float = 0.95  # of the interval
    note: str = ""

    @classmethod
    def of_row(cls, row: Mapping[str, Any]) -> Estimate:
        """The estimate that a row of a table holds."""
        return cls(**{one.name: row[one.name] for one in fields(cls) if one.name in row})

    @classmethod
    def missing(cls, n: int, note: str) -> Estimate:
        """No estimate, for a reason."""
        nan = float("nan")
        return cls(nan, nan, nan, n, note=note)

    @classmethod
    def between(cls, value: float, low: float, high: float, n: int, p: float = float("nan")) -> Estimate:
        """An estimate with its interval; without interval and p where that has no width: units that are all alike say nothing
        of others."""
        if high - low > ROUNDING * max(abs(low), abs(high)):
            return cls(value, low, high, n, p)
        return cls(value, float("nan"), float("nan"), n, note=ALIKE if np.isfinite([low, high]).all() else NOT_FINITE)

    def told_from(self, nothing: float, data: str) -> Estimate:
        """The estimate; with a note that ``data``, e.g. "400 frames of 32 episodes", do not tell it from ``nothing``, where its
        interval, or its value if it has none, does not lie above."""
        if not (self.estimate if np.isnan(self.low) else self.low) <= nothing:
            return self
        return replace(self, note=f"{self.note}; " * bool(self.note) + f"{data} do not tell it from nothing")

    def row(self, **more: Any) -> dict[str, Any]:
        """The estimate as a row of a table, after the columns ``more``."""
        return {**more, **asdict(self)}


def difference(a: Any, b: Any) -> Floats:
    """``a - b``, and 0 where they differ by rounding only, by 1e-12 of them."""
    return np.where(np.isclose(a, b, rtol=ROUNDING, atol=0.0), 0.0, np.subtract(a, b))


def student_p(value: float, error: float, freedom: float, sides: int = 1) -> float:
    """The p of 0 by Student's law, for a value with this standard ``error``: one-sided of its being above 0, or two-sided;
    NaN without an error."""
    size = abs(value) if sides == 2 else value
    return sides * float(stats.t.sf(size / error, freedom)) if error else float("nan")


def mean_of_replicates(values: Sequence[float] | Floats, chance: float | None = None, sides: int = 1) -> Estimate:
    """The mean of independent replicates with Student's interval; ``p`` of its being above ``chance``, or with two ``sides``
    of its being another.

    Replicates that share their data vary only by what was drawn anew in each: the interval says nothing about other
    data. Of a single replicate, or of equal ones, there is a mean, but no interval and no p.
    """
    x = np.asarray(values, np.float64)
    n = len(x)
    if not n:
        return Estimate.missing(0, "there is no replicate")
    mean = float(np.mean(x))
    if n < 2:
        return Estimate(mean, np.nan, np.nan, n, note="one replicate has no interval")
    error = float(x.std(ddof=1) / np.sqrt(n))
    half = float(stats.t.ppf(0.975, n - 1)) * error
    p = float("nan") if chance is None else student_p(mean - chance, error, n - 1, sides)
    return Estimate.between(mean, mean - half, mean + half, n, p)
