"""When a claim counts as reproduced: rules that are the same for all claims and scales, and depend on no result.

*An effect is claimed* (a correlation or a difference of a sign):

- **reproduced**: it has that sign, and p < 0.05 (two-sided);
- **not reproduced**: it has the other sign with p < 0.05, or its 95 % interval leaves out every effect of the claimed sign
  that would matter (a correlation of 0.3, a difference of a fifth of a standard deviation);
- **undecided**: neither. Nothing was found, and an effect that matters is not ruled out: there are too few runs.

*It is claimed that there is nothing*:

- **reproduced**: the whole interval lies within what does not matter;
- **not reproduced**: p < 0.05, and the interval reaches beyond what does not matter;
- **undecided**: neither. Finding nothing is not finding that there is nothing.

*It is claimed that nothing is significant* (at 0.05, or "weakly at best": at 0.01): **reproduced** where p is at least that,
**not reproduced** where it is below. That says how few the runs are as much as how weak the effect is.

*No number can be had*, because the runs are not there or nothing varies: **not testable**.

A claim about several panels is reproduced if it is in each, not reproduced if it fails in any, undecided otherwise. Where
any of several tests could decide (panels, families, sets of levels), p-values are corrected by Holm in the corrected
reading, and not in the paper's, which did not correct.

Runs of a panel and a seed share levels, so they stay together as a *block*: intervals and p-values of blocks are those of a
bootstrap of whole blocks, or where there are fewer than 20, of Student's law and the jackknife that leaves out one at a time.
"""

import math
from collections.abc import Iterable

from analysis.stats.estimate import Estimate

REPRODUCED, NOT_REPRODUCED, UNDECIDED, NOT_TESTABLE = "reproduced", "not reproduced", "undecided", "not testable"
VERDICTS = (REPRODUCED, NOT_REPRODUCED, UNDECIDED, NOT_TESTABLE)

ALPHA = 0.05
SMALL_R = 0.3  # a correlation below this does not matter; Cohen's "medium", and what 45 independent points can rule out
SMALL_D = 0.2  # a difference below this many standard deviations does not matter; Cohen's "small"
WEAK = 0.01  # a p-value above this is "weakly significant at best"


def of_effect(found: Estimate, sign: int, margin: float = SMALL_R) -> str:
    """The verdict on a claimed effect of that ``sign``; effects smaller than ``margin`` do not matter."""
    if not math.isfinite(found.estimate):
        return NOT_TESTABLE
    if is_significant(found):
        return REPRODUCED if found.estimate * sign > 0 else NOT_REPRODUCED
    best = found.high if sign > 0 else -found.low
    return NOT_REPRODUCED if math.isfinite(best) and best < margin else UNDECIDED


def of_absence(found: Estimate, margin: float = SMALL_R) -> str:
    """The verdict on the claim that there is no effect, but for one smaller than ``margin``."""
    if not math.isfinite(found.estimate):
        return NOT_TESTABLE
    if -margin < found.low and found.high < margin:
        return REPRODUCED
    return NOT_REPRODUCED if is_significant(found) else UNDECIDED


def of_insignificance(found: Estimate, alpha: float = ALPHA) -> str:
    """The verdict on the claim that p is at least ``alpha``."""
    if not math.isfinite(found.p):
        return NOT_TESTABLE
    return REPRODUCED if found.p >= alpha else NOT_REPRODUCED


def is_significant(found: Estimate) -> bool:
    """p < 0.05; where there is no p, an interval that leaves out 0."""
    if math.isfinite(found.p):
        return found.p < ALPHA
    return found.low > 0 or found.high < 0


def combined(verdicts: Iterable[str]) -> str:
    """The verdict on a claim about several panels, from those on each."""
    each = list(verdicts)
    if not each or all(one == NOT_TESTABLE for one in each):
        return NOT_TESTABLE
    if NOT_REPRODUCED in each:
        return NOT_REPRODUCED
    return REPRODUCED if all(one == REPRODUCED for one in each) else UNDECIDED
