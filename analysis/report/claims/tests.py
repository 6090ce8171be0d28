"""A test as data, and what runs say of it: the same for the paper's claims and for those of a user's study."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import pandas as pd
from scipy import stats

from segar.analysis.report.claims.claim import Finding
from segar.analysis.report.claims.evidence import Evidence, matrix, pearson
from segar.analysis.report.number_format import signed
from segar.analysis.report.results import BLOCK, paired
from segar.analysis.report.rules import MARGINS
from segar.analysis.stats.correlation import explained
from segar.analysis.stats.estimate import Estimate
from segar.analysis.tables import column, count_of, keep
from segar.experiments.reproduction.experiment_file import SIGNS
from segar.experiments.reproduction.grid import NUMBERS_OF_LEVELS

SAME = ("family", "difficulty", "n", "seed")  # what the runs of a pair share, unless a test says otherwise
DUMMIES = {"one_level": "[n = 1]", "log_n": "log n"}  # which know nothing of levels
# Outcomes in shares of levels, and where they end; a gap closes at 0.
ENDS = {"gap_success": (-1.0, 0.0), "last_trial": (0.0, 1.0)} | {
    f"success_{levels}_{mode}": (0.0, 1.0) for levels in ("train", "test") for mode in ("deterministic", "sampled")
}
OUTER = (0.05, 0.95)  # percentiles between which nine of ten runs lie
Found = tuple[str, Estimate, float]  # what the estimate is, the estimate, and the margin that follows from the rows


@dataclass(frozen=True)
class StatedTest:
    """One test of a claim, by the names of columns of its runs.

    ``correlation``  Pearson's r of ``of`` and ``against`` given the columns ``given``
    ``slope``        the slope of ``of`` on ``against`` in least squares given the columns ``given``
    ``rank``         Spearman's correlation of ``of`` and ``against``, less that of ``of`` and the column ``less`` where there
                     is one, over rows that differ in them, in blocks of the columns ``blocks``
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
    where: Mapping[str, Any] = field(default_factory=dict)  # only the runs with one of these values
    several: str = ""  # a column that must have two values or more
    room: str = ""  # the share of levels that is asked for room, where the outcome of a correlation is none
    margin: float | str = ""  # a number, the name of a rule's margin, or what the rules have for such a test


def finding_of(evidence: Evidence, rows: pd.DataFrame, test: StatedTest, settings: str) -> Finding | None:
    """What the rows say of a test; None where no rows are those that it is about."""
    rows = restricted(rows, test.where)
    if rows.empty or (test.several and count_of(rows, test.several) < 2):
        return None
    measure, found, usual = TESTS[test.test](evidence, rows, test)
    margin = MARGINS.get(test.margin, usual) if isinstance(test.margin, str) else test.margin
    beside = dummies(rows, test) if test.test == "correlation" else ""
    sign, room = SIGNS[test.expected], no_room(rows, test, margin)
    return Finding(settings, test.words, measure, found, margin, sign, lacks_room=room, beside=beside)


def no_room(rows: pd.DataFrame, test: StatedTest, margin: float) -> str:
    """Why the outcome, a share of levels, leaves no room for an effect as large as the margin; "" where it does."""
    share = test.room or test.of
    if share not in ENDS or share not in rows:
        return ""
    if test.between:
        first = differences(rows, test.of, test.between, test.same)
        partner = column(first, test.of) - column(first, "difference")
        values = np.concatenate([column(first, test.of), partner])
    else:
        values = column(rows, share)
    if not np.isfinite(values).any():
        return ""
    low, high = np.nanquantile(values, OUTER)
    least = MARGINS["success"]
    if any(max(abs(low - end), abs(high - end)) < least for end in ENDS[share]):
        return f"no room: {share} is within {least:g} of its end in nine of ten runs"
    if not test.between or test.margin != "success" or test.expected == "none":
        return ""
    bottom, top = ENDS[share]
    room = float(top - partner.mean() if test.expected == "positive" else partner.mean() - bottom)
    return f"no room: {share} can change by {room:.3f} at most, less than {margin:g}" if room < margin else ""


def dummies(rows: pd.DataFrame, test: StatedTest) -> str:
    """What [n = 1] and log n say in place of a distance, where the number of levels varies and is not given."""
    if not test.against.startswith("w2_") or count_of(rows, "n") < 2 or {*test.given} & {*NUMBERS_OF_LEVELS}:
        return ""
    known = rows.assign(one_level=(column(rows, "n") == 1).astype(float))
    found = {words: pearson(known, name, test.of, test.given) for name, words in DUMMIES.items()}
    return ", ".join(f"{words} {signed(one.estimate)}" for words, one in found.items())


def correlation(evidence: Evidence, rows: pd.DataFrame, test: StatedTest) -> Found:
    """Pearson's r, partial where something is given."""
    rows = keep(rows, np.isfinite(column(rows, test.of)) & np.isfinite(column(rows, test.against)))
    found = evidence.correlation(rows, test.against, test.of, test.given)
    return "partial Pearson r" if test.given else "Pearson r", found, MARGINS["correlation"]


def slope(evidence: Evidence, rows: pd.DataFrame, test: StatedTest) -> Found:
    """The slope of least squares."""
    return "slope", evidence.slope(rows, test.against, test.of, test.given), small_difference(rows, test.of)


def rank(evidence: Evidence, rows: pd.DataFrame, test: StatedTest) -> Found:
    """Spearman's correlation, or how much larger it is than that of another column."""
    names = [test.of, test.against, *test.less]
    rows = rows.dropna(subset=names).drop_duplicates([*names, *test.blocks])
    values, is_one = rows[names].to_numpy(np.float64), not test.less
    found = evidence.by_blocks(rows, values, rank_correlation, tuple(test.blocks), correlation=is_one)
    return "Spearman r" if is_one else "difference of Spearman r", found, MARGINS["correlation"]


def mean(evidence: Evidence, rows: pd.DataFrame, test: StatedTest) -> Found:
    """The mean over runs, or over pairs of runs."""
    if test.between:
        rows, of = differences(rows, test.of, test.between, test.same), "difference"
    else:
        rows, of = keep(rows, np.isfinite(column(rows, test.of))), test.of
    measure = "mean difference" if test.test == "difference" else "mean"
    return measure, evidence.mean(rows, of), small_difference(rows, of)


def explained_by(evidence: Evidence, rows: pd.DataFrame, test: StatedTest) -> Found:
    """R² on some columns less R² on others."""
    if not (test.by and test.less):
        raise ValueError(f"{test.words}: a test of R² takes by and less")
    one, other = (matrix(rows, names) for names in (test.by, test.less))
    values = np.column_stack([column(rows, test.of), one, other])
    found = evidence.by_blocks(rows, values, difference_of_r2(one.shape[1]), tuple(test.blocks))
    return "difference of R²", found, MARGINS["explained"]


TESTS: Mapping[str, Callable[[Evidence, pd.DataFrame, StatedTest], Found]] = {
    "correlation": correlation, "slope": slope, "rank": rank, "difference": mean, "mean": mean, "explained": explained_by,
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


def small_difference(rows: pd.DataFrame, of: str) -> float:
    """The difference of returns that would matter: a part of the standard deviation of the values."""
    return MARGINS["deviations"] * float(column(rows, of).std(ddof=1)) if len(rows) > 1 else 0.0


def rank_correlation(values: np.ndarray) -> float:
    """Spearman's correlation of the first two columns, less that of the first and the third where there is one."""
    first, *other = np.corrcoef(stats.rankdata(values, axis=0), rowvar=False)[0, 1:]
    return float(first - sum(other))


def difference_of_r2(width: int) -> Callable[[np.ndarray], float]:
    """R² of the first column on the next ``width`` ones less R² on the rest; NaN where one cannot be had."""

    def difference(values: np.ndarray) -> float:
        y, sets = values[:, 0], (values[:, 1 : 1 + width], values[:, 1 + width :])
        one, other = (explained(y, x) for x in sets)
        return one - other

    return difference
