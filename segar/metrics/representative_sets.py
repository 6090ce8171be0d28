"""The worth of a level set: its coverage, the effective number of levels, and the entropy of their distribution."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
import scipy

from segar.errors import LevelError, did_you_mean
from segar.language import Factor, GlobalFriction
from segar.levels import LevelDistribution, Levels, checks, entity_types
from segar.metrics.points import Spread, Units, cut, relevant_factors
from segar.metrics.wasserstein import MISMATCH, exact_costs

STAND_IN = 2000  # levels that stand for a distribution
STAND_IN_SPLIT = "representativeness"
"""Split of these levels, so that they are no train or test levels."""
NEIGHBOUR = 3  # k of the nearest-neighbour estimate of an entropy: low bias, and a variance near that of larger k
FEWEST = 10  # values from which the density of one factor is estimated


@dataclass(frozen=True)
class Coverage:
    """Distances from levels of the distribution (or of another set) to the nearest level of a set.

    Attributes:
        radius: the largest: every level is within it of some level of the set.
        high: their 95 % quantile. mean: their mean.
    """

    radius: float
    high: float
    mean: float


def coverage(
    levels: Levels,
    of: Levels | LevelDistribution,
    *,
    rng: np.random.Generator | None = None,
    mismatch: float = MISMATCH,
    scale: Spread | None = None,
    factors: Sequence[type[Factor]] | None = None,
) -> Coverage:
    """How far the levels of a distribution, or of another set, are from the nearest of ``levels``, in exact distance.

    Args:
        of: the other set, or a distribution, for which 2,000 levels stand whose seed ``rng`` draws. So the radius is
            that of these levels; with more of them it grows, slowly.
        Others as for :func:`segar.metrics.w2`.

    Raises:
        LevelError: not a level set, or a distribution without ``rng``.
    """
    if not isinstance(of, Levels):
        if rng is None:
            raise LevelError("coverage of a distribution draws levels from it: coverage(levels, distribution, rng=...)")
        checks.require_distribution("coverage", of)
        checks.require_generator("coverage", rng)
        of = of.sample(STAND_IN, seed=int(rng.integers(2**62)), split=STAND_IN_SPLIT)
    units = Units.checked("coverage", (levels, of), scale, factors)
    checks.require_size("coverage", "mismatch", mismatch)
    costs = exact_costs(of, levels, entity_types(of, levels), units, mismatch)
    nearest = np.sqrt(costs.min(axis=1))
    return Coverage(float(nearest.max()), float(np.quantile(nearest, 0.95)), float(nearest.mean()))


def effective_number(
    levels: Levels,
    *,
    mismatch: float = MISMATCH,
    scale: Spread | None = None,
    factors: Sequence[type[Factor]] | None = None,
) -> float:
    """How many levels without any similarity the set is worth, from 1 (all equal) to its length (all unlike).

    The diversity of order 1 of Leinster and Cobbold (2012) for equal weights, exp(-mean_i log z_i), where z_i is the mean
    similarity exp(-d) of level i to all levels, itself included, and d the exact distance in standard deviations.
    Arguments and errors are those of :func:`segar.metrics.w2`.
    """
    units = Units.checked("effective_number", (levels,), scale, factors)
    checks.require_size("effective_number", "mismatch", mismatch)
    costs = exact_costs(levels, levels, entity_types(levels), units, mismatch)
    typical = np.exp(-np.sqrt(np.maximum(costs, 0.0))).mean(axis=1)
    return float(np.exp(-np.log(typical).mean()))


@dataclass(frozen=True)
class SampleEntropy:
    """An estimate of an entropy in nats; lengths are in the factors' own units.

    Attributes:
        value: ``discrete`` + ``continuous``.
        discrete: Shannon entropy of what is chosen: which entities there are, and which atoms factors take.
        continuous: mean differential entropy of the rest, given what is chosen. It may be negative.
        left_out: share of the levels (``joint``) or values (``mean_field``) that are too few of their kind to estimate a
            density from, and that ``continuous`` leaves out.
    """

    value: float
    discrete: float
    continuous: float
    left_out: float


def sample_entropy(
    levels: Levels,
    method: Literal["joint", "mean_field"] = "joint",
    *,
    factors: Sequence[type[Factor]] | None = None,
) -> SampleEntropy:
    """The entropy of the distribution that levels were drawn from, estimated from the levels as drawn, slot by slot.

    A value that occurs twice in a slot is an atom, since densities do not repeat; all others come from a density.

    ``joint``: of all factors together. Levels of one kind (same entities in the same slots, same atoms) are vectors of
    what is left, and their entropy is Kozachenko and Leonenko's estimate by 3rd nearest neighbours (in units of the
    standard deviation, undone afterwards); that of the kinds is the plug-in one with Miller and Madow's correction.
    ``mean_field``: the sum over slots and factors, as if they were independent: an upper bound, and all that few levels of
    many kinds allow; densities by ``scipy.stats.differential_entropy``.

    Both smooth over the ends of a distribution's support, so they are a little too high: ``joint`` by 0.3 nats for 2,000 levels
    with five uniform or Gaussian factors, more for more factors and fewer levels.

    Args:
        factors: count these factors and no others. World parameters count.

    Raises:
        LevelError: not a level set, an unknown method, or no kind of level (``joint``) that occurs often enough.
    """
    checks.require_levels("sample_entropy", levels)
    checks.require_factors("sample_entropy", factors, levels)
    if method not in ("joint", "mean_field"):
        raise LevelError(
            f"sample_entropy: unknown method '{method}'.{did_you_mean(str(method), ('joint', 'mean_field'))}"
        )
    columns, slots = _columns(levels, factors)
    return _joint(levels.types, columns) if method == "joint" else _mean_field(levels.types, columns, slots)


def _columns(levels: Levels, factors: Sequence[type[Factor]] | None) -> tuple[np.ndarray, np.ndarray]:
    """Values of each component of each slot's factors, float64 ``[levels, columns]``, nan where there are none; and the
    slot of each column, that of the arena's floor for world parameters."""
    layout = levels.layout
    found, slots = [np.zeros((len(levels), 0))], []
    for slot in range(len(layout.slots)):
        kinds = [layout.types[k] for k in np.unique(levels.types[:, slot]) if k >= 0]
        kinds = [k for k in kinds if not issubclass(k, GlobalFriction)]
        for factor in dict.fromkeys(f for kind in kinds for f in relevant_factors(kind, factors)):
            found.append(cut(levels.sampled_values[:, slot, layout.columns_of(factor)], factor))
            slots += [slot] * factor.width
    chosen = [k for k, p in enumerate(layout.parameters) if factors is None or p in factors]
    found += [cut(levels.parameters[:, [k]], layout.parameters[k]) for k in chosen]
    slots += [len(layout.slots) - 1] * len(chosen)
    return np.concatenate(found, axis=1), np.array(slots, dtype=int)


def _joint(types: np.ndarray, columns: np.ndarray) -> SampleEntropy:
    atoms = np.stack([_atoms(column) for column in columns.T], axis=1) if columns.shape[1] else columns.astype(int)
    kinds, kind, times = np.unique(
        np.concatenate([types, atoms], axis=1), axis=0, return_inverse=True, return_counts=True
    )
    kind, free = kind.ravel(), kinds[:, types.shape[1] :] == -1
    parts = []
    for k in range(len(kinds)):
        if not free[k].any():
            parts.append((times[k], 0.0))
        elif times[k] > NEIGHBOUR:
            parts.append((times[k], _neighbour_entropy(columns[kind == k][:, free[k]])))
    used = sum(n for n, _ in parts)
    if not used:
        raise LevelError(
            f"sample_entropy: no kind of level occurs more than {NEIGHBOUR} times among these {len(types)}; take more"
            " levels, fewer factors=[...], or method='mean_field'"
        )
    continuous = sum(n * h for n, h in parts) / used
    return _result(_plug_in(times), continuous, 1 - used / len(types))


def _mean_field(types: np.ndarray, columns: np.ndarray, slots: np.ndarray) -> SampleEntropy:
    discrete, continuous, seen, missed = 0.0, 0.0, 0, 0
    for slot, chosen in enumerate(types.T):
        discrete += _plug_in(np.unique(chosen, return_counts=True)[1])
        for kind in np.unique(chosen[chosen >= 0]):
            for column in columns[chosen == kind][:, slots == slot].T:
                atom = _atoms(column)
                share = len(column) / len(types)
                discrete += share * _plug_in(np.unique(atom, return_counts=True)[1])
                rest = column[atom == -1]
                seen += len(rest)
                if len(rest) >= FEWEST:
                    continuous += len(rest) / len(types) * float(scipy.stats.differential_entropy(rest))
                else:
                    missed += len(rest)
    return _result(discrete, continuous, missed / seen if seen else 0.0)


def _result(discrete: float, continuous: float, left_out: float) -> SampleEntropy:
    return SampleEntropy(float(discrete + continuous), float(discrete), float(continuous), float(left_out))


def _atoms(column: np.ndarray) -> np.ndarray:
    """A number for each atom of a column, -1 for values that occur once, -2 where there is no value: int ``[levels]``."""
    _, place, times = np.unique(column, return_inverse=True, return_counts=True)
    return np.where(np.isnan(column), -2, np.where(times[place] > 1, place, -1))


def _plug_in(times: np.ndarray) -> float:
    """Shannon entropy of frequencies, plus (kinds - 1) / 2n (Miller 1955)."""
    return float(scipy.special.entr(times / times.sum()).sum() + (len(times) - 1) / (2 * times.sum()))


def _neighbour_entropy(points: np.ndarray) -> float:
    """psi(n) - psi(k) + log volume of the unit ball + d mean log distance to the k-th neighbour, ``points [n, d]``."""
    n, d = points.shape
    unit = points.std(axis=0)
    distance = scipy.spatial.KDTree(points / unit).query(points / unit, k=NEIGHBOUR + 1)[0][:, NEIGHBOUR]
    ball = 0.5 * d * np.log(np.pi) - scipy.special.gammaln(0.5 * d + 1)
    counts = scipy.special.digamma(n) - scipy.special.digamma(NEIGHBOUR)
    return float(counts + ball + d * np.log(distance).mean() + np.log(unit).sum())
