"""Level sets of one size that differ from independent ones in one measure and are like them in the others.

In independent sets, the distance to the test levels, the covering radius and the diversity vary together. Matched sets take
them apart, so that a study can ask which of them predicts a generalization gap.
"""

from collections.abc import Callable

import numpy as np

from segar.errors import LevelError
from segar.levels import LevelDistribution, Levels, checks, content_hash, entity_types
from segar.metrics.level_design import DESIGN_SPLIT, pool_size
from segar.metrics.points import Units, spread
from segar.metrics.wasserstein import MISMATCH, exact_costs
from segar.support import emd

INDEPENDENT_SETS = 100  # whose means and standard deviations are the units
STEPS = 6000  # of the search: sets that are tried, each with one level exchanged
WARMTH = 1.0  # of the search at its start, in squared standard deviations; it falls to zero
MEASURES = ("w2", "radius", "effective_number")


def matched_set(
    dist: LevelDistribution,
    n: int,
    *,
    test: Levels,
    w2: float = 0.0,
    radius: float = 0.0,
    effective_number: float = 0.0,
    seed: int = 0,
    split: str = "train",
    pool: int | None = None,
    tolerance: float = 0.3,
) -> Levels:
    """``n`` levels of a distribution that are as far from independent sets as wanted, in three measures at once.

    The measures are exact :func:`segar.metrics.w2` to ``test``, ``coverage(levels, test).radius`` and
    :func:`segar.metrics.effective_number`. Each wanted value is a number of standard deviations from the mean over
    independent sets of n levels; 0 is like an independent set. The levels are picked from the first ``pool`` ones of the
    split by simulated annealing (Kirkpatrick, Gelatt and Vecchi 1983).

    >>> test = segar.family("empty-medium").sample(50, seed=0, split="test")
    >>> segar.metrics.matched_set(segar.family("empty-medium"), 10, test=test, w2=3.0, seed=1)
    <10 levels of 'empty-medium', seed 1, split 'train'>

    Args:
        n, seed, split: as for ``dist.sample``; the choice depends on them, on ``test`` and on what is wanted only.
        test: the levels to which distances are measured.
        w2, radius, effective_number: what is wanted, in standard deviations of independent sets.
        pool: how many levels to pick from; by default 20 n, at least 1,000.
        tolerance: how far each measure may end from what is wanted, in the same units.

    Raises:
        LevelError: an argument is wrong, or no such set was found; the message says what was reached.
        PlacementError: as for ``dist.sample``.
    """
    checks.require_distribution("matched_set", dist)
    checks.require_levels("matched_set", test)
    checks.require_size("matched_set", "tolerance", tolerance)
    wanted = np.array([w2, radius, effective_number], np.float64)
    if not np.isfinite(wanted).all() or tolerance == 0:
        raise LevelError(
            f"matched_set: what is wanted must be finite and the tolerance above 0, not {wanted.tolist()} and {tolerance!r}"
        )
    levels = dist.sample(pool_size(n, pool), seed=seed, split=split)
    rng = np.random.default_rng(int(content_hash([DESIGN_SPLIT, dist.hash, int(seed), split, *wanted.tolist()]), 16))
    measures = _measures(levels, test)
    independent = np.array([measures(rng.choice(len(levels), n, replace=False)) for _ in range(INDEPENDENT_SETS)])
    mean, unit = independent.mean(axis=0), independent.std(axis=0, ddof=1)
    if not (unit > 0).all():
        constant = ", ".join(name for name, value in zip(MEASURES, unit, strict=True) if not value > 0)
        raise LevelError(
            f"matched_set: {constant} is the same for all sets of {n} levels of {dist!r}; nothing to match"
        )
    rows, reached = _search(lambda rows: (measures(rows) - mean) / unit, wanted, tolerance, len(levels), n, rng)
    if np.abs(reached - wanted).max() > tolerance:
        said = ", ".join(
            f"{name} {a:+.2f} instead of {b:+.2f}" for name, a, b in zip(MEASURES, reached, wanted, strict=True)
        )
        raise LevelError(
            f"matched_set: no {n} levels of the pool of {len(levels)} were found within {tolerance:g} standard deviations of "
            f"what is wanted; the nearest set has {said}. Ask for less, or for a larger pool or tolerance"
        )
    return levels[rows]


def _measures(levels: Levels, test: Levels) -> Callable[[np.ndarray], np.ndarray]:
    """The function that gives the three measures, float64 ``[3]``, of the levels at some places."""
    types, units = entity_types(levels, test), Units(spread(levels, test))
    costs = exact_costs(levels, test, types, units, MISMATCH)
    within = exact_costs(levels, levels, types, Units(spread(levels)), MISMATCH)
    similarity = np.exp(-np.sqrt(np.maximum(within, 0.0)))

    def measured(rows: np.ndarray) -> np.ndarray:
        part = costs[rows]
        typical = similarity[np.ix_(rows, rows)].mean(axis=1)
        return np.array([np.sqrt(emd(part)), np.sqrt(part.min(axis=0).max()), np.exp(-np.log(typical).mean())])

    return measured


def _search(
    standard: Callable[[np.ndarray], np.ndarray], wanted: np.ndarray, tolerance: float, pool: int, n: int,
    rng: np.random.Generator,
) -> tuple[np.ndarray, np.ndarray]:  # fmt: skip
    """The places of ``n`` levels, and their measures in standard deviations: the first set within half the tolerance, or the
    best of all that were tried."""
    rows = rng.choice(pool, n, replace=False)
    now = standard(rows)
    best = (float(np.abs(now - wanted).max()), rows, now)
    for step in range(STEPS):
        if best[0] <= tolerance / 2:
            break
        new = int(rng.integers(pool))
        if new in rows:
            continue
        changed = rows.copy()
        changed[int(rng.integers(n))] = new
        value = standard(changed)
        worse = float(np.square(value - wanted).sum() - np.square(now - wanted).sum())
        if worse < 0 or rng.random() < np.exp(-worse / (WARMTH * (1 - step / STEPS))):
            rows, now = changed, value
            best = min(best, (float(np.abs(now - wanted).max()), rows, now), key=lambda one: one[0])
    return best[1], best[2]
