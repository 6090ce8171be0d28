"""Wasserstein-2 distance between two level sets: transport of levels, over transport of their entities."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from segar import language
from segar.errors import LevelError, did_you_mean
from segar.language import Drag, Entity, Factor
from segar.levels import Levels, checks, entity_types, gather
from segar.metrics.points import Spread, Units
from segar.metrics.transport import balanced_costs, matching_costs, sliced_costs
from segar.metrics.unseen import warn_of_unseen
from segar.support import emd, pot

Mode = Literal["exact", "reference", "paper"]

MISMATCH = float(np.sqrt(12.0))
"""Cost of an entity without counterpart, in standard deviations: the whole range of a uniformly distributed factor. The
cut-off that follows, sqrt(24), is the diagonal of a uniform box, so that no two places in it count as unrelated."""

REFERENCE_MISMATCH = 100.0  # of the 2022 implementation, in its unscaled units
REFERENCE_PROJECTIONS = 50
REFERENCE_SEED = 0

SAME = 1e-9  # distances that differ by a smaller part are equal: those of one deal in another order do, by rounding

REFERENCE_ORDER: tuple[type[Factor], ...] = (
    language.Size, language.Position, language.Visible, language.Order, language.Mobile, language.Velocity,
    language.Mass, language.Charge, language.Density, language.Magnetism, language.StoredEnergy,
    language.InfiniteEnergy, language.Alive, language.Done, language.Acceleration, language.Friction, language.Heat,
)  # fmt: skip
"""Order of the factors in the 2022 vectors, which decides what its fixed projections see."""


@dataclass(frozen=True)
class Resampled:
    """A distance between sets of points, such as levels or rule sets, with what it takes to read it.

    Attributes:
        value: the distance.
        low, high: ``value`` -/+ 1.96 standard errors over bootstrap resamples of both sets of levels, cut off at 0. The
            resamples' own mean is no centre: resampled levels repeat, which moves the sets apart. NaN where a set has one
            level, or all resamples are as far apart, which says nothing of other levels.
        floor: mean distance of two sets of the same sizes dealt at random from all points of both: what the distance
            would be if both were from one distribution.
        p_value: share of such deals (the given one counted in) that are at least as far apart as ``value``: the
            permutation test of equal distributions.
        resamples: of either kind.
    """

    value: float
    low: float
    high: float
    floor: float
    p_value: float
    resamples: int


@dataclass(frozen=True)
class W2Report(Resampled):
    """The distance of two level sets as :func:`w2` returns it, with the other attributes of :class:`Resampled`.

    Attributes:
        unseen: in what the sets differ that the distance does not see; see :func:`unseen_differences`.
    """

    mode: Mode
    unseen: tuple[str, ...] = ()


def w2(
    a: Levels,
    b: Levels,
    mode: Mode = "exact",
    *,
    mismatch: float | None = None,
    scale: Spread | None = None,
    factors: Sequence[type[Factor]] | None = None,
) -> float:
    """The Wasserstein-2 distance between two level sets, W2(a, b) = sqrt(min over couplings of E C(level, level')).

    The modes differ in the squared distance C of two levels:

    ``exact``: the sum over entity types of the best partial matching of their entities, of which each matched pair costs
        the squared Euclidean distance of its relevant factors in units of their spread, and each entity left over costs
        ``mismatch`` squared (:func:`segar.metrics.transport.matching_costs`). So counts may differ, and two entities of
        different types cost two mismatches. Two entities of one type never cost more than two mismatches squared: farther
        than sqrt(2) ``mismatch``, by default 4.9 standard deviations, they are left over both, so that the distance stops
        growing. Read from the states that episodes start in, world parameters included;
        flags, render order and derived factors are left out (``segar.metrics.points.IRRELEVANT``); along a factor with a
        ``period`` the shorter way round counts. It is a metric for a fixed ``scale``, hence among sets that carry one
        distribution.
    ``reference``: as the 2022 implementation: entities fall into two types only, objects and tiles, by the factors that
        they have; all factors as sampled, unscaled, render order and flags included; the squared sliced distance over 50
        projections of seed 0. Different counts: both sides are uniform measures. None on one side: ``mismatch`` squared.
    ``paper``: Algorithm 1 of the paper as written: types are classes, states all factors as sampled, unscaled, exact W2;
        where one level lacks a type that the other has, C *becomes* ``mismatch`` (not its square), and later types add to
        that. So the result depends on the order of types, which is that of first appearance in a, then b. Its "unbalanced
        EMD" is balanced here as in 2022, since both sets have mass one.

    >>> train, test = segar.family("empty-easy").sample(50, seed=0), segar.family("empty-hard").sample(50, seed=0)
    >>> segar.metrics.w2(train, train), segar.metrics.w2(train, test) > 1
    (0.0, True)

    Args:
        a, b: the level sets, e.g. train and test.
        mismatch: price of an entity, or type, without counterpart. ``exact``: in standard deviations, default sqrt(12).
            Otherwise in the unscaled units of the vectors, default 100.
        scale: ``exact`` only: the units, from :func:`segar.metrics.spread`; default ``spread(a, b)``. A factor whose
            spread is 0 or missing has no weight; a warning names it if the sets differ in it.
        factors: ``exact`` only: count these factors and no others, e.g. ``[Position]``.

    Raises:
        LevelError: not two level sets, an unknown mode, or an option that the mode does not have; ``scale`` has a key that is
            no factor of an entity type and no world parameter, or a unit that is negative or not finite; no ``factors``.

    Warns:
        UnseenDifferenceWarning: the sets differ in something that the mode leaves out (world parameters in ``reference`` and
            ``paper``; flags and the order of tiles in ``exact``), that has no weight in ``scale``, or that no mode sees
            (rules); once, with their names. See :func:`segar.metrics.unseen_differences`.

    Source: the paper's Algorithm 1; Peyré and Cuturi 2019, section 2.
    """
    cost = cost_function("w2", a, b, mode, mismatch, scale, factors)
    warn_of_unseen("w2", a, b, mode, factors, scale)
    return float(np.sqrt(emd(cost(a, b))))


def cost_matrix(
    a: Levels,
    b: Levels,
    mode: Mode = "exact",
    *,
    mismatch: float | None = None,
    scale: Spread | None = None,
    factors: Sequence[type[Factor]] | None = None,
) -> np.ndarray:
    """Squared distances C of the levels of two sets, float64 ``[len(a), len(b)]``, for any optimal transport of levels.

    ``w2(a, b)`` is the root of the least mean of C over couplings. `Python Optimal Transport (POT)
    <https://pythonot.github.io>`_ solves other problems from the same matrix: entropic, unbalanced, partial transport.
    Arguments and errors are those of :func:`w2`. Several matrices compare only with one ``scale`` for all.
    """
    cost = cost_function("cost_matrix", a, b, mode, mismatch, scale, factors)
    warn_of_unseen("cost_matrix", a, b, mode, factors, scale)
    return cost(a, b)


def w2_report(
    a: Levels,
    b: Levels,
    mode: Mode = "exact",
    *,
    rng: np.random.Generator,
    resamples: int = 100,
    mismatch: float | None = None,
    scale: Spread | None = None,
    factors: Sequence[type[Factor]] | None = None,
) -> W2Report:
    """The distance with its confidence interval over levels, its floor and a test of equal distributions.

    Arguments and errors are those of :func:`w2`; ``resamples`` (at least 2) counts both bootstrap draws and random deals.

    Source: the bootstrap of Efron (1979) for the interval, Fisher's permutation test for the floor and the p-value.
    """
    checks.require_generator("w2_report", rng)
    checks.require_count("w2_report", "resamples", resamples, 2)
    cost = cost_function("w2_report", a, b, mode, mismatch, scale, factors)
    unseen = warn_of_unseen("w2_report", a, b, mode, factors, scale)
    between = cost(a, b)
    pooled = np.block([[cost(a, a), between], [cost(b, a), cost(b, b)]])
    return W2Report(**vars(resampled(pooled, len(a), rng, resamples)), mode=mode, unseen=unseen)


def resampled(pooled: np.ndarray, n: int, rng: np.random.Generator, resamples: int) -> Resampled:
    """The W2 distance of the first ``n`` points and all others, by bootstrap draws and random deals of them.

    Args:
        pooled: squared distances of all points, float64 ``[n + m, n + m]``.
    """
    between = pooled[:n, n:]
    value, m = float(np.sqrt(emd(between))), between.shape[1]
    drawn = []
    for _ in range(resamples):
        times_a, times_b = rng.multinomial(n, np.full(n, 1 / n)), rng.multinomial(m, np.full(m, 1 / m))
        drawn.append(np.sqrt(emd(between, times_a, times_b)))
    margin = 1.96 * float(np.std(drawn, ddof=1))
    if min(n, m) == 1 or margin <= SAME * value:
        margin = float("nan")
    dealt = []
    for _ in range(resamples):
        deal = rng.permutation(n + m)
        dealt.append(np.sqrt(emd(pooled[np.ix_(deal[:n], deal[n:])])))
    p_value = float((1 + sum(d >= (1 - SAME) * value for d in dealt)) / (1 + resamples))
    return Resampled(value, max(value - margin, 0.0), value + margin, float(np.mean(dealt)), p_value, resamples)


def cost_function(
    what: str,
    a: Levels,
    b: Levels,
    mode: str,
    mismatch: float | None,
    scale: Spread | None,
    factors: Sequence[type[Factor]] | None,
):
    """The function from two level sets to the matrix of squared distances of their levels, with all options settled.

    ``what`` is the function in whose name wrong options are refused.
    """
    checks.require_levels(what, a, b)
    if mode not in ("exact", "reference", "paper"):
        raise LevelError(f"{what}: unknown mode '{mode}'.{did_you_mean(str(mode), ('exact', 'reference', 'paper'))}")
    if mode != "exact" and (scale is not None or factors is not None):
        raise LevelError(f"{what}: mode='{mode}' takes neither scale nor factors; they belong to mode='exact'")
    if mismatch is None:
        mismatch = MISMATCH if mode == "exact" else REFERENCE_MISMATCH
    checks.require_size(what, "mismatch", mismatch)
    types = entity_types(a, b)
    if mode == "reference":
        return lambda x, y: reference_costs(x, y, types, mismatch)
    if mode == "paper":
        return lambda x, y: paper_costs(x, y, types, mismatch)
    units = Units.checked(what, (a, b), scale, factors)
    return lambda x, y: exact_costs(x, y, types, units, mismatch)


def exact_costs(a: Levels, b: Levels, types: Sequence[type[Entity]], units: Units, mismatch: float) -> np.ndarray:
    """Squared distances of levels in mode ``exact``, float64 ``[len(a), len(b)]``; see :func:`w2`."""
    costs = np.zeros((len(a), len(b)))
    for entity in types:
        costs += matching_costs(units.state(a, entity), units.state(b, entity), mismatch)
    varied = units.parameters(a, b)
    if varied:
        costs += balanced_costs(units.world(a, varied), units.world(b, varied), absent=0.0)
    return costs


def reference_costs(a: Levels, b: Levels, types: Sequence[type[Entity]], mismatch: float) -> np.ndarray:
    """Squared distances of levels in mode ``reference``, float64 ``[len(a), len(b)]``; see :func:`w2`.

    A type is a list of factors; the entities that have all of them belong to it. With the built-in entities these are
    objects (18 numbers) and tiles (7 numbers).
    """
    costs = np.zeros((len(a), len(b)))
    for factors in dict.fromkeys(reference_factors(t) for t in types):
        members = [t for t in types if set(factors) <= set(reference_factors(t))]
        of_a, of_b = (gather(levels, members, factors, levels.sampled_values) for levels in (a, b))
        costs += sliced_costs(of_a, of_b, reference_projections(sum(f.width for f in factors)), mismatch**2)
    return costs


def reference_factors(entity: type[Entity]) -> tuple[type[Factor], ...]:
    """The numeric factors of an entity type in the order of 2022, those unknown to it last.

    Drag is left out: it is how this implementation keeps track of friction, and 2022 had none.
    """
    numeric = [f for f in entity.declared if f.width and f is not Drag]
    return (*(f for f in REFERENCE_ORDER if f in numeric), *(f for f in numeric if f not in REFERENCE_ORDER))


def reference_projections(dimension: int) -> np.ndarray:
    """The directions that POT's ``sliced_wasserstein_distance(seed=0)`` draws, float64 ``[dimension, 50]``."""
    return pot().sliced.get_random_projections(dimension, REFERENCE_PROJECTIONS, seed=REFERENCE_SEED)


def paper_costs(a: Levels, b: Levels, types: Sequence[type[Entity]], mismatch: float) -> np.ndarray:
    """The matrix C of the paper's Algorithm 1, float64 ``[len(a), len(b)]``; see :func:`w2`."""
    costs = np.zeros((len(a), len(b)))
    for entity in types:
        states = [gather(levels, [entity], reference_factors(entity), levels.sampled_values) for levels in (a, b)]
        differ = (states[0].counts[:, None] == 0) != (states[1].counts[None, :] == 0)
        costs = np.where(differ, mismatch, costs + balanced_costs(*states, absent=0.0))
    return costs
