"""Kolmogorov-Smirnov statistics of samples and distributions, per factor and for all factors at once."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import scipy

from segar.errors import LevelError
from segar.language import Factor, require_own_names
from segar.levels import LevelDistribution, Levels, checks
from segar.metrics.distribution_functions import Curve, SampleAgainstDistribution, TwoSamples, factor_marginals
from segar.metrics.joint_kernel import largest_difference
from segar.metrics.unseen import warn_of_unseen

Side = Levels | LevelDistribution

MONTE_CARLO_SPLIT = "kolmogorov-smirnov"
"""Split of the levels that a test draws from a distribution, so that they are no train or test levels."""


@dataclass(frozen=True)
class FactorKS:
    """The statistic of one marginal, with what it takes to read it.

    Attributes:
        name: such as ``"GolfBall.Position.x"``, ``"Charger.count"`` or ``"world.Gravity"``.
        value: sup_x |F(x) - G(x)|.
        band: half width of the 95 % band around the difference of the empirical distribution
            functions, in which the true one lies at all x at once. Sample against distribution: sqrt(ln(40) / 2n)
            (Dvoretzky, Kiefer and Wolfowitz 1956, Massart 1990). Two samples: sqrt(ln(40) (1/n + 1/m) / 2), its
            asymptotic form. So ``value > band`` speaks against one distribution.
        p_value: of the hypothesis of one distribution; exact without atoms, too large with atoms.
        n: values in the first sample. m: in the second, None where that is a distribution.
    """

    name: str
    value: float
    band: float
    p_value: float
    n: int
    m: int | None


@dataclass(frozen=True)
class KSReport:
    """The mean-field statistic with its test, and every marginal's.

    Attributes:
        value: as :func:`ks` returns it.
        p_value: of the hypothesis that both sides have one distribution, by ``resamples`` repetitions under it: the
            levels of two sets are dealt at random; of a distribution, as many levels are drawn as the sample has. The test
            is exact whatever the factors' dependence, since whole levels are dealt or drawn.
        factors: the marginals, most different (smallest p-value, then largest value) first.
        unseen: in what both sides differ that the statistic does not see; see :func:`segar.metrics.unseen_differences`.
    """

    value: float
    p_value: float
    factors: tuple[FactorKS, ...]
    resamples: int
    unseen: tuple[str, ...] = ()


def ks(a: Side, b: Side, *, factors: Sequence[type[Factor]] | None = None) -> float:
    """The Kolmogorov-Smirnov statistic of two level sets or distributions under the mean-field distribution, in [0, 1].

    KS = sup_x |prod_j F_j(x_j) - prod_j G_j(x_j)|, F_j and G_j the distribution functions of the j-th marginal in a and b:
    every component of every relevant factor of every entity type (over all entities of that type), the number of
    entities of each type in a level, and every world parameter. The paper's text has probabilities P[X_j = x_j] in the
    product; distribution functions are meant, as in its Algorithm 2.

    ``ks(train, test)`` compares samples by their states that episodes start in; ``ks(train, dist)`` a sample as drawn
    (before overlaps were removed) with the known distributions of its factors, also exactly; ``ks(dist_a, dist_b)`` the
    distributions with each other, the joint supremum over a grid of 1/512 in probability. What placement adds
    (``min_distance``, overlaps) is in no distribution. A factor with a ``period`` is cut at plus and minus half of it.

    >>> train, test = segar.family("empty-easy"), segar.family("empty-hard")
    >>> segar.metrics.ks(train, train), segar.metrics.ks(train, test) > 0.1
    (0.0, True)

    Args:
        factors: count these factors and no others (numbers of entities count always).

    Raises:
        LevelError: one of the two is neither levels nor a distribution, or a factor's prior depends on other factors, so
            that its distribution is known through samples only.
    """
    found = joint_difference([m.curve() for m in factor_marginals("ks", a, b, factors)])
    warn_of_unseen("ks", a, b, "exact", factors)
    return found


def ks_by_factor(a: Side, b: Side, *, factors: Sequence[type[Factor]] | None = None) -> dict[str, float]:
    """The Kolmogorov-Smirnov statistic sup_x |F_j(x) - G_j(x)| of each marginal, by name; exact.

    Names are ``"Charger.Charge"``, ``"GolfBall.Position.x"``, ``"Charger.count"`` (entities of the type per level) and
    ``"world.Gravity"``. A factor is compared among the entities that there are: of a type that one side lacks, there is
    the count alone. Arguments and errors are those of :func:`ks`; besides, two entity types or two world parameters of
    both sides must not have one name.
    """
    marginals = factor_marginals("ks_by_factor", a, b, factors)
    _require_own_names("ks_by_factor", a, b)
    found = {m.name: m.largest_difference() for m in marginals}
    warn_of_unseen("ks_by_factor", a, b, "exact", factors)
    return found


def ks_report(
    a: Side,
    b: Side,
    *,
    rng: np.random.Generator,
    resamples: int = 199,
    factors: Sequence[type[Factor]] | None = None,
) -> KSReport:
    """The statistic with bands, p-values, and the marginals in order of evidence: two level sets, or levels and a distribution.

    With many marginals some p-value is small by chance: read the joint one first.

    Args:
        rng: for the joint test; ``resamples`` (at least 19) repetitions, so that p is at least 1 / (1 + resamples).

    Raises:
        LevelError: as :func:`ks`; or both are distributions, whose distance has no error to report.
    """
    checks.require_generator("ks_report", rng)
    checks.require_count("ks_report", "resamples", resamples, 19)
    if not isinstance(a, Levels):
        a, b = b, a
    if not isinstance(a, Levels):
        raise LevelError("ks_report: the distance of two distributions is exact; use ks(a, b) or ks_by_factor(a, b)")
    marginals = factor_marginals("ks_report", a, b, factors)
    _require_own_names("ks_report", a, b)
    value = joint_difference([m.curve() for m in marginals])
    null = _dealt(marginals, a, b, rng, resamples) if isinstance(b, Levels) else _drawn(a, b, factors, rng, resamples)
    found = [_factor_report(m) for m in marginals]
    return KSReport(
        value=value,
        p_value=float((1 + np.sum(np.asarray(null) >= value - 1e-12)) / (1 + resamples)),
        factors=tuple(sorted(found, key=lambda f: (f.p_value, -f.value))),
        resamples=resamples,
        unseen=warn_of_unseen("ks_report", a, b, "exact", factors),
    )


def _require_own_names(what: str, a: Side, b: Side) -> None:
    """Raise :class:`LevelError` where names of marginals would be ambiguous."""
    require_own_names(f"entity types in {what}", [*a.layout.types, *b.layout.types])
    require_own_names(f"world parameters in {what}", [*a.layout.parameters, *b.layout.parameters])


def dkw_band(n: int) -> float:
    """Half width of the 95 % band around an empirical distribution function that contains the true one at all x at once.

    sqrt(ln(2 / 0.05) / 2n), for n independent values of any distribution (Massart 1990).
    """
    return float(np.sqrt(np.log(40) / (2 * n)))


def _factor_report(marginal: TwoSamples | SampleAgainstDistribution) -> FactorKS:
    value = marginal.largest_difference()
    if isinstance(marginal, SampleAgainstDistribution):
        n = len(marginal.sample)
        p_value = float(scipy.stats.kstwo.sf(value, n))
        return FactorKS(marginal.name, value, dkw_band(n), p_value, n, None)
    n, m = len(marginal.x), len(marginal.y)
    method = "exact" if max(n, m) <= 1000 else "asymp"
    p_value = float(scipy.stats.ks_2samp(marginal.x, marginal.y, method=method).pvalue)  # type: ignore[union-attr]
    band = dkw_band(1) * np.sqrt(1 / n + 1 / m)
    return FactorKS(marginal.name, value, float(band), min(p_value, 1.0), n, m)


def _dealt(
    marginals: Sequence[TwoSamples], a: Levels, b: Levels, rng: np.random.Generator, resamples: int
) -> list[float]:
    """Joint statistics of the levels of both sets, dealt at random."""
    found = []
    for _ in range(resamples):
        first = np.zeros(len(a) + len(b), dtype=bool)
        first[rng.permutation(len(first))[: len(a)]] = True
        found.append(joint_difference([m.dealt(first, len(a)) for m in marginals]))
    return found


def _drawn(
    a: Levels,
    distribution: LevelDistribution,
    factors: Sequence[type[Factor]] | None,
    rng: np.random.Generator,
    resamples: int,
) -> list[float]:
    """Joint statistics of level sets that are drawn from the distribution, each as large as ``a``."""
    n = len(a)
    pool = distribution.sample(n * resamples, seed=int(rng.integers(2**62)), split=MONTE_CARLO_SPLIT)
    # A constant that is what the distribution says adds a factor of one to both products.
    marginals = [m for m in factor_marginals("ks_report", pool, distribution, factors) if not m.is_constant]
    return [joint_difference(curves) for curves in zip(*(m.parts(n, resamples) for m in marginals), strict=True)]


def joint_difference(curves: Sequence[Curve]) -> float:
    """The largest difference of the products of the functions of ``curves``, each ascending in both; in [0, 1]."""
    f, g = (np.concatenate([np.ones(1), *(curve[k] for curve in curves)]) for k in range(2))
    ends = np.cumsum([1, *(len(curve[0]) for curve in curves)])
    return float(max(largest_difference(f, g, ends), largest_difference(g, f, ends)))
