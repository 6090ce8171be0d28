"""Designed level sets: n levels of a distribution that are clustered, spread out, or at a chosen distance from a test set.

Distances between train and test shrink as sets grow; sets of one size at several distances separate the two effects.
"""

import dataclasses
from collections.abc import Sequence
from typing import Literal

import numpy as np

from segar.errors import LevelError, did_you_mean
from segar.language import Factor, Position, Size
from segar.levels import LevelDistribution, Levels, checks, content_hash, entity_types
from segar.metrics.points import Units, spread
from segar.metrics.targets import nearest_to_target
from segar.metrics.wasserstein import MISMATCH, cost_function, exact_costs, w2
from segar.support import is_whole

Kind = Literal["iid", "clustered", "covering", "nuisance_only", "target"]
KINDS = ("iid", "clustered", "covering", "nuisance_only", "target")

POOL_PER_LEVEL = 20
SMALLEST_POOL = 1000
DESIGN_SPLIT = "design"
"""Names the random choices of a design among those of its distribution and seed."""


def design(
    dist: LevelDistribution,
    n: int,
    kind: Kind = "iid",
    *,
    seed: int = 0,
    split: str = "train",
    pool: int | None = None,
    nuisance: Sequence[type[Factor]] = (),
    test: Levels | None = None,
    target: float | None = None,
    tolerance: float | None = None,
) -> Levels:
    """``n`` levels of a distribution, of the closeness that ``kind`` names.

    All but ``nuisance_only`` pick levels from the first ``pool`` ones of the split, so
    ``dist.sample(pool, seed, split)[levels.provenance.indices]`` are the same levels again.

    >>> segar.design(segar.family("empty-hard"), 3, "clustered", seed=0)
    <3 levels of 'empty-hard', seed 0, split 'train'>

    - ``iid``: the first n; the same as ``dist.sample(n, seed, split)``.
    - ``clustered``: a level picked at random, and the n - 1 levels of the pool nearest to it, nearest first.
    - ``covering``: levels far from each other and near all others: the level in the middle of the pool, then again and
      again the one farthest from all those picked (Gonzalez 1985: no other n levels cover the pool within less than
      half the radius).
    - ``nuisance_only``: one level, picked at random, n times, with the ``nuisance`` factors as in n other levels of the pool
      that have the same entities. ``provenance.indices`` are those of the n levels that lend the nuisance factors,
      ``provenance.name`` says the one level, and ``provenance.distribution`` is another than dist's, since dist does not
      draw such levels.
    - ``target``: levels whose distance ``w2(levels, test)`` is within ``tolerance`` of ``target``.

    Args:
        n, seed, split: as for ``dist.sample``; the choice at random depends on them and on nothing else.
        pool: how many levels to pick from; by default 20 n, at least 1,000.
        nuisance: ``nuisance_only``: factors that vary, e.g. ``[Order, Mass]``; of all entities that have them. If Position
            or Size varies, things are moved out of each other as in any level.
        test, target, tolerance: ``target`` only; the tolerance is 1 % of the target by default.

    Raises:
        LevelError: an option is missing, of the wrong kind, or another kind's; there are not enough levels of one sort in
            the pool; the nuisance factors do not vary; or the target is out of reach, and the message names the range
            that was reached.
        PlacementError: as for ``dist.sample``.
    """
    checks.require_distribution("design", dist)
    _check_kind(kind, nuisance, test, target, tolerance)
    size = pool_size(n, None if kind == "iid" else pool)
    if kind == "iid":
        return dist.sample(n, seed=seed, split=split)
    levels = dist.sample(size, seed=seed, split=split)
    rng = np.random.default_rng(int(content_hash([DESIGN_SPLIT, dist.hash, int(seed), split]), 16))
    if kind == "clustered":
        centre = int(rng.integers(size))
        return levels[np.argsort(_distances_from(levels, centre, Units(spread(levels))), kind="stable")[:n]]
    if kind == "covering":
        return levels[_farthest_first(levels, n)]
    if kind == "nuisance_only":
        return _nuisance_only(levels, int(rng.integers(size)), n, nuisance)
    assert test is not None and target is not None
    return _at_target(levels, n, test, target, 0.01 * target if tolerance is None else tolerance, rng)


def pool_size(n: int, pool: int | None) -> int:
    """How many levels ``n`` are picked from."""
    if not is_whole(n) or n < 1:
        raise LevelError(f"design: the number of levels must be a whole number above 0, not {n!r}")
    size = max(POOL_PER_LEVEL * n, SMALLEST_POOL) if pool is None else pool
    if not is_whole(size) or size < n:
        raise LevelError(f"design: {n} levels cannot be picked from a pool of {size}")
    return size


def _check_kind(
    kind: str,
    nuisance: Sequence[type[Factor]],
    test: Levels | None,
    target: float | None,
    tolerance: float | None,
) -> None:
    if kind not in KINDS:
        raise LevelError(f"design: unknown kind '{kind}'.{did_you_mean(str(kind), KINDS)}")
    if (kind == "nuisance_only") != bool(nuisance):
        raise LevelError("design: kind='nuisance_only' needs nuisance=[factors], and no other kind takes it")
    if isinstance(nuisance, (str, type)) or any(
        not (isinstance(f, type) and issubclass(f, Factor) and f.width) for f in nuisance
    ):
        raise LevelError(f"design: nuisance must be factors that are numbers, such as [Order, Mass], not {nuisance!r}")
    if (kind == "target") != (test is not None and target is not None) or (
        kind != "target" and (test, target, tolerance) != (None,) * 3
    ):
        raise LevelError("design: kind='target' needs test=levels and target=distance, and no other kind takes them")
    if target is not None and not (0 < target < np.inf and (tolerance is None or 0 < tolerance < np.inf)):
        raise LevelError(f"design: target and tolerance must be positive numbers, not {target!r} and {tolerance!r}")


def _distances_from(levels: Levels, place: int, units: Units) -> np.ndarray:
    """Exact squared distance of each level to the one at ``place``, float64 ``[levels]``."""
    return exact_costs(levels[place], levels, entity_types(levels), units, MISMATCH)[0]


def _farthest_first(levels: Levels, n: int) -> np.ndarray:
    units = Units(spread(levels))
    some = np.arange(min(len(levels), SMALLEST_POOL))
    among = exact_costs(levels[some], levels[some], entity_types(levels), units, MISMATCH)
    picked = [int(among.mean(axis=1).argmin())]
    nearest = _distances_from(levels, picked[0], units)
    while len(picked) < n:
        nearest[picked[-1]] = -1.0  # never again, even where levels are equal
        picked.append(int(nearest.argmax()))
        nearest = np.minimum(nearest, _distances_from(levels, picked[-1], units))
    return np.array(picked)


def _nuisance_only(levels: Levels, place: int, n: int, nuisance: Sequence[type[Factor]]) -> Levels:
    one = levels[place]
    lenders = np.flatnonzero((levels.types == one.types).all(axis=1))
    if len(lenders) < n:
        raise LevelError(
            f"design: only {len(lenders)} levels of the pool of {len(levels)} have the same entities as level {place};"
            f" {n} are needed. Take a larger pool, or another seed"
        )
    varied, made = levels[lenders[:n]], one[[0] * n]
    columns: list[int] = []
    for factor in nuisance:
        if factor not in levels.layout.columns:
            raise LevelError(f"design: no entity of {levels.distribution} has the nuisance factor {factor.__name__}")
        columns += range(levels.layout.columns[factor], levels.layout.columns[factor] + factor.width)
    names = ", ".join(factor.__name__ for factor in nuisance)
    lent = varied.sampled_values[..., columns]
    if n > 1 and np.array_equal(lent, np.broadcast_to(lent[:1], lent.shape), equal_nan=True):
        raise LevelError(f"design: {names} is the same in the {n} levels that would lend it: nothing would vary")
    values, sampled = made.values.copy(), made.sampled_values.copy()
    values[..., columns], sampled[..., columns] = varied.values[..., columns], varied.sampled_values[..., columns]
    origin = levels.provenance
    provenance = dataclasses.replace(
        origin,
        name=f"level {place} of {origin.name or origin.distribution} with other {names}",
        distribution=content_hash(["nuisance_only", origin.distribution, place, names]),
        indices=varied.provenance.indices,
    )
    made = dataclasses.replace(made, values=values, sampled_values=sampled, provenance=provenance)
    return made.without_overlaps() if {Position, Size} & set(nuisance) else made


def _at_target(
    levels: Levels, n: int, test: Levels, target: float, tolerance: float, rng: np.random.Generator
) -> Levels:
    costs = cost_function("design", levels, test, "exact", None, None, None)(levels, test)
    found, low, high = nearest_to_target(costs, n, target, tolerance, rng)
    picked = levels[found]
    distance = w2(picked, test)
    if abs(distance - target) > tolerance:
        raise LevelError(
            f"design: no {n} levels of the pool of {len(levels)} were found at W2 {target:g} ± {tolerance:g} from the test"
            f" set; the nearest is {distance:.4g}, and the sets tried reach from {low:.4g} to {high:.4g}. Take a target"
            " in this range, or a larger pool or tolerance"
        )
    return picked
