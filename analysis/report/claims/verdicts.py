"""Verdicts: what an estimate says about a claim, by the rules in ``analysis/report/rules.yaml``.

The rules are the same for all claims and scales, and depend on no result.
"""

import math
from collections import Counter
from collections.abc import Iterable

from scipy import stats

from segar.analysis.report.rules import ALPHA
from segar.analysis.stats.estimate import Estimate
from segar.analysis.stats.resampling import to_normal

SUPPORTED, NOT_SUPPORTED, UNDECIDED = "supported", "not supported", "undecided"
NOT_YET, NOT_TESTABLE = "not yet tested", "cannot be tested"
VERDICTS = (SUPPORTED, NOT_SUPPORTED, UNDECIDED, NOT_YET, NOT_TESTABLE)


def of_effect(found: Estimate, sign: int, margin: float) -> str:
    """The verdict on a claimed effect of that ``sign``; effects smaller than ``margin`` do not matter."""
    if not is_known(found):
        return NOT_TESTABLE
    if is_significant(found) and found.estimate * sign < 0:
        return NOT_SUPPORTED
    if is_significant(found) and found.estimate * sign >= margin:
        return SUPPORTED
    largest = found.high if sign > 0 else -found.low
    return NOT_SUPPORTED if largest < margin else UNDECIDED


def of_absence(found: Estimate, margin: float) -> str:
    """The verdict on the claim that there is no effect, but for one smaller than ``margin``."""
    if not is_known(found):
        return NOT_TESTABLE
    if -margin < found.low and found.high < margin:
        return SUPPORTED
    return NOT_SUPPORTED if is_significant(found) and abs(found.estimate) > margin else UNDECIDED


def is_known(found: Estimate) -> bool:
    """Whether there is an estimate with an interval."""
    return all(math.isfinite(value) for value in (found.estimate, found.low, found.high))


def counted(read: Iterable[str]) -> str:
    """``2 supported, 1 undecided``."""
    found = Counter(read)
    return ", ".join(f"{found[name]} {name}" for name in VERDICTS if found[name])


def is_significant(found: Estimate) -> bool:
    """p < 0.05; where there is no p, an interval that leaves out 0."""
    if math.isfinite(found.p):
        return found.p < ALPHA
    return found.low > 0 or found.high < 0


def combined(verdicts: Iterable[str]) -> str:
    """The verdict on a claim with several tests, from those on each."""
    each = list(verdicts)
    if not each or all(one == NOT_TESTABLE for one in each):
        return NOT_TESTABLE
    if NOT_SUPPORTED in each:
        return NOT_SUPPORTED
    return SUPPORTED if all(one == SUPPORTED for one in each) else UNDECIDED


def power_at_margin(found: Estimate, margin: float, correlation: bool) -> float:
    """How probable p < 0.05 is for an effect as large as ``margin``, from the width of the interval; NaN without one.

    Correlations are taken in Fisher's transform. The error is that of the estimate at hand, so this is the power of the
    design, and not that of the result.
    """
    if not is_known(found):
        return float("nan")
    ends = [found.low, found.high, margin]
    low, high, size = map(float, to_normal(ends) if correlation else ends)
    quantile = float(stats.norm.ppf(1 - ALPHA / 2))
    error = (high - low) / (2 * quantile)
    if error == 0:
        return 1.0
    return float(stats.norm.sf(quantile - size / error) + stats.norm.cdf(-quantile - size / error))
