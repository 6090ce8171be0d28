"""A test as data, and what runs say of it: the same for the paper's claims and for those of a user's study."""

import dataclasses
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import pandas as pd

from analysis.report.claims.claim import Finding
from analysis.report.claims.evidence import Evidence, matrix
from analysis.report.results import BLOCK, paired
from analysis.report.rules import MARGINS
from analysis.stats.association import holm
from analysis.stats.correlation import explained
from analysis.stats.estimate import Estimate
from analysis.tables import column, count_of, keep
from experiments.reproduction.experiment_file import SIGNS

SAME = ("family", "difficulty", "n", "seed")  # what the runs of a pair share, unless a test says otherwise
Found = tuple[str, Estimate, float]  # what the estimate is, the estimate, and the margin that follows from the rows


@dataclass(frozen=True)
class StatedTest:
    """One test of a claim, by the names of columns of its runs.

    ``correlation``  Pearson's r of ``of`` and ``against`` given the columns ``given``
    ``difference``   the mean of ``of`` at one value of a column less that at another over pairs of runs that are equal in the
                     columns ``same``; ``between`` names the column and the two values, or several such pairs. Without
                     ``between``, the mean of ``of``, which is a difference already
    ``mean``         the mean of ``of``
    ``explained``    R² of ``of`` on the columns ``by`` less R² on the columns ``less``
    """

    test: str
    expected: str  # negative, positive or none
    words: str  # what is tested
    of: str
    against: str = ""
    given: Sequence[str] = ()
    between: Mapping[str, Sequence[Any]] = field(default_factory=dict)
    same: Sequence[str] = SAME
    by: Sequence[str] = ()
    less: Sequence[str] = ()
    blocks: Sequence[str] = BLOCK  # of R²: the columns whose values rows of a block share
    where: Mapping[str, Any] = field(
        default_factory=dict
    )  # only the runs with these values, or one of a list of values
    several: str = ""  # a column that must have two values or more
    margin: float | str = ""  # a number, the name of a rule's margin, or what the rules have for such a test


def finding_of(evidence: Evidence, rows: pd.DataFrame, test: StatedTest, settings: str) -> Finding | None:
    """What the rows say of a test; None where no rows are those that it is about."""
    rows = restricted(rows, test.where)
    if rows.empty or (test.several and count_of(rows, test.several) < 2):
        return None
    measure, found, usual = TESTS[test.test](evidence, rows, test)
    margin = MARGINS.get(test.margin, usual) if isinstance(test.margin, str) else test.margin
    return Finding(settings, test.words, measure, found, margin, SIGNS[test.expected])


def correlation(evidence: Evidence, rows: pd.DataFrame, test: StatedTest) -> Found:
    """Pearson's r, partial where something is given."""
    rows = keep(rows, np.isfinite(column(rows, test.of)) & np.isfinite(column(rows, test.against)))
    found = evidence.correlation(rows, test.against, test.of, test.given)
    return "partial Pearson r" if test.given else "Pearson r", found, MARGINS["correlation"]


def difference(evidence: Evidence, rows: pd.DataFrame, test: StatedTest) -> Found:
    """The mean over pairs of runs."""
    if test.between:
        rows, of = differences(rows, test.of, test.between, test.same), "difference"
    else:
        rows, of = keep(rows, np.isfinite(column(rows, test.of))), test.of
    return "mean difference", mean_of(evidence, rows, of), small_difference(rows, of)


def mean(evidence: Evidence, rows: pd.DataFrame, test: StatedTest) -> Found:
    """The mean over runs."""
    rows = keep(rows, np.isfinite(column(rows, test.of)))
    return "mean", mean_of(evidence, rows, test.of), small_difference(rows, test.of)


def explained_by(evidence: Evidence, rows: pd.DataFrame, test: StatedTest) -> Found:
    """R² on some columns less R² on others."""
    one, other = (matrix(rows, names) for names in (test.by, test.less))
    if one is None or other is None:
        raise ValueError(f"{test.words}: a test of R² takes by and less")
    values = np.column_stack([column(rows, test.of), one, other])
    found = evidence.by_blocks(rows, values, difference_of_r2(one.shape[1]), tuple(test.blocks))
    return "difference of R²", found, MARGINS["explained"]


TESTS: Mapping[str, Callable[[Evidence, pd.DataFrame, StatedTest], Found]] = {
    "correlation": correlation, "difference": difference, "mean": mean, "explained": explained_by,
}  # fmt: skip


def restricted(rows: pd.DataFrame, where: Mapping[str, Any]) -> pd.DataFrame:
    """The rows with the given values, or one of a list of values, in some columns."""
    for name, value in where.items():
        values = {str(one) for one in (value if isinstance(value, list | tuple) else [value])}
        rows = keep(rows, [str(one) in values for one in rows[name]])
    return rows


def differences(rows: pd.DataFrame, of: str, between: Mapping[str, Sequence[Any]], same: Sequence[str]) -> pd.DataFrame:
    """The runs with the first of two values of a column, with ``difference``: what they have less what their partners with the
    second value have."""
    ((by, values),) = between.items()
    pairs = values if isinstance(values[0], list | tuple) else [values]
    parts = [paired(restricted(rows, {by: a}), restricted(rows, {by: b}), of, same) for a, b in pairs]
    return pd.concat(parts, ignore_index=True)


def mean_of(evidence: Evidence, rows: pd.DataFrame, of: str) -> Estimate:
    """The mean of a column with the interval of blocks; of no rows, none."""
    return evidence.mean(rows, of) if len(rows) else Estimate.missing(0, "no such runs")


def small_difference(rows: pd.DataFrame, of: str) -> float:
    """The difference of returns that would matter: a part of the standard deviation of the values."""
    return MARGINS["deviations"] * float(column(rows, of).std(ddof=1)) if len(rows) > 1 else 0.0


def difference_of_r2(width: int) -> Callable[[np.ndarray], float]:
    """R² of the first column on the next ``width`` ones less R² on the rest; NaN where one cannot be had."""

    def difference(values: np.ndarray) -> float:
        y, sets = values[:, 0], (values[:, 1 : 1 + width], values[:, 1 + width :])
        one, other = (explained(y, x) for x in sets)
        return one - other

    return difference


def with_holm(findings: Sequence[Finding]) -> list[Finding]:
    """The tests of one claim of an effect with Holm's p-values, which can only weaken it."""
    p = holm([one.found.p for one in findings])
    corrected = (dataclasses.replace(one.found, p=float(q)) for one, q in zip(findings, p, strict=True))
    return [
        dataclasses.replace(one, found=found, corrected=True) for one, found in zip(findings, corrected, strict=True)
    ]
