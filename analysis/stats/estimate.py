"""A number with what it takes to judge it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
from scipy import stats


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
    def missing(cls, n: int, note: str) -> Estimate:
        """No estimate, for a reason."""
        nan = float("nan")
        return cls(nan, nan, nan, n, note=note)

    def row(self, **more: Any) -> dict[str, Any]:
        """The estimate as a row of a table, after the columns ``more``."""
        return {**more, **asdict(self)}


def mean_of_replicates(values: Sequence[float], chance: float | None = None, level: float = 0.95) -> Estimate:
    """The mean of independent replicates with Student's interval; ``p`` of its being above ``chance``, one-sided.

    Replicates that share their data vary only by what was drawn anew in each: the interval says nothing about other
    data. Of a single replicate there is a mean, but no interval and no p.
    """
    x = np.asarray(values, np.float64)
    n, mean = len(x), float(np.mean(x))
    if n < 2:
        return Estimate(mean, np.nan, np.nan, n, level=level, note="one replicate has no interval")
    error = float(x.std(ddof=1) / np.sqrt(n))
    half = float(stats.t.ppf(0.5 + level / 2, n - 1)) * error
    if chance is None:
        p = float("nan")
    elif error == 0:
        p = 0.0 if mean > chance else 1.0
    else:
        p = float(stats.t.sf((mean - chance) / error, n - 1))
    return Estimate(mean, mean - half, mean + half, n, p, level)
