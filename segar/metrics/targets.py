"""Which rows of a cost matrix, as a level set of their own, are at a wanted Wasserstein-2 distance from its columns."""

import numpy as np

from segar.support import emd

SWAPS = 400  # sets that are tried at most, each with one level exchanged, once no further step along the path helps


def nearest_to_target(
    costs: np.ndarray, n: int, target: float, tolerance: float, rng: np.random.Generator
) -> tuple[np.ndarray, float, float]:
    """``n`` distinct rows whose W2 to all columns is as near to ``target`` as was found, int ``[n]``; and the least and
    the largest W2 of the sets that were tried.

    The search walks from a near set by way of an independent one (the first n rows) to a far one, one row at a time in
    random order, by bisection, and then exchanges single rows.

    Args:
        costs: squared distances, float64 ``[pool, m]``, pool >= n.
    """
    tried: dict[tuple[int, ...], float] = {}

    def distance(rows: np.ndarray) -> float:
        key = tuple(np.sort(rows).tolist())
        if key not in tried:
            tried[key] = float(np.sqrt(emd(costs[list(key)])))
        return tried[key]

    near, middle, far = _near_rows(costs, n), np.arange(n), max(_far_rows(costs, n), key=distance)
    path = _path(near, middle, rng) + _path(middle, far, rng)[1:]
    stations = [0, len(path) // 2, len(path) - 1]
    values = [distance(path[k]) for k in stations]
    best = min((path[k] for k in stations), key=lambda rows: abs(distance(rows) - target))
    for low, high in ((0, 1), (1, 2)):
        if (values[low] - target) * (values[high] - target) <= 0:
            rows = _bisect(path, stations[low], stations[high], target, tolerance, distance)
            best = min(best, rows, key=lambda rows: abs(distance(rows) - target))
    best = _exchange(best, len(costs), target, tolerance, distance, rng)
    return best, min(tried.values()), max(tried.values())


def _near_rows(costs: np.ndarray, n: int) -> np.ndarray:
    """Rows picked one by one so that the mean over columns of the cost to the nearest picked row falls most."""
    picked: list[int] = []
    nearest = np.full(costs.shape[1], np.inf)
    for _ in range(n):
        mean = np.minimum(costs, nearest).mean(axis=1)
        # Once rows no longer help, the rest are those nearest to any column.
        order = np.lexsort((costs.min(axis=1), mean))
        taken = set(picked)
        row = next(int(r) for r in order if int(r) not in taken)
        picked.append(row)
        nearest = np.minimum(nearest, costs[row])
    return np.array(picked)


def _far_rows(costs: np.ndarray, n: int) -> tuple[np.ndarray, np.ndarray]:
    """The rows of largest mean cost; and the rows whose costs are most like those of the very largest one, a far crowd."""
    mean = costs.mean(axis=1)
    profile = np.sqrt(costs)
    unlike = ((profile - profile[mean.argmax()]) ** 2).sum(axis=1)
    return np.argsort(-mean, kind="stable")[:n], np.argsort(unlike, kind="stable")[:n]


def _path(first: np.ndarray, last: np.ndarray, rng: np.random.Generator) -> list[np.ndarray]:
    """Sets of distinct rows from ``first`` to ``last``, each with one row exchanged."""
    leave = rng.permutation(np.setdiff1d(first, last))
    enter = rng.permutation(np.setdiff1d(last, first))
    sets = [np.array(first)]
    for old, new in zip(leave, enter, strict=True):
        sets.append(np.where(sets[-1] == old, new, sets[-1]))
    return sets


def _bisect(path, low: int, high: int, target: float, tolerance: float, distance) -> np.ndarray:
    """A set of the path where the distance crosses the target between stations on its two sides."""
    rising = distance(path[low]) <= target
    while high - low > 1:
        middle = (low + high) // 2
        if abs(distance(path[middle]) - target) <= tolerance:
            return path[middle]
        low, high = (middle, high) if (distance(path[middle]) <= target) == rising else (low, middle)
    return min(path[low], path[high], key=lambda rows: abs(distance(rows) - target))


def _exchange(
    rows: np.ndarray, pool: int, target: float, tolerance: float, distance, rng: np.random.Generator
) -> np.ndarray:
    """The set after exchanges of single rows that bring the distance nearer to the target."""
    for _ in range(SWAPS):
        if abs(distance(rows) - target) <= 0.5 * tolerance:  # rounding, and rare types' units, stay within the rest
            break
        new = int(rng.integers(pool))
        if new in rows:
            continue
        changed = rows.copy()
        changed[int(rng.integers(len(rows)))] = new
        if abs(distance(changed) - target) < abs(distance(rows) - target):
            rows = changed
    return rows
