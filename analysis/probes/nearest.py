"""Mutual information from distances to nearest neighbours (Kraskov, Stögbauer and Grassberger 2004, first estimator)."""

from typing import Any

import numpy as np
from scipy import stats
from scipy.spatial import KDTree
from scipy.special import digamma

from segar.analysis.stats.estimate import Estimate, student_p
from segar.analysis.tables import Floats, Ints
from segar.errors import SegarError

NEIGHBOURS = 3
PARTS = 10  # from whose scatter the error is told
DRAWS = 10  # of one frame of each episode


def ksg(x: Any, z: Any) -> float:
    """Mutual information of ``x`` [N, d] (or [N]) and ``z`` [N, k] (or [N]) in nats.

    Both may have any number of dimensions, but the estimate falls short in more than about 10 of them, and where the
    information is more than a few nats. Distances are maxima over components, so components should have like units.
    Where values repeat, as of a law with atoms, neighbours at distance 0 are counted as Gao et al. (2017) do. Where
    none does it is psi(k) + psi(N) - <psi(n_x + 1) + psi(n_z + 1)>, on average right for independent x and z.

    Raises:
        SegarError: there are not more points than neighbours, or a value is not finite.
    """
    x, z = _points(x), _points(z)
    n = len(x)
    if len(z) != n or n <= NEIGHBOURS:
        raise SegarError(f"ksg needs as many x as z, and more than {NEIGHBOURS}; not {n} and {len(z)}")
    if not (np.isfinite(x).all() and np.isfinite(z).all()):
        raise SegarError("ksg cannot read values that are not finite; leave out the rows where a factor is missing")
    both = np.concatenate([x, z], axis=1)
    radius = KDTree(both).query(both, NEIGHBOURS + 1, p=np.inf)[0][:, -1]
    repeated = radius == 0
    # Strictly within the radius: the largest number below it, as KDTree counts what lies at the radius, too.
    inside = np.where(repeated, 0.0, np.nextafter(radius, 0))
    counts = [_count(part, inside) for part in (x, z)]
    near = np.where(repeated, _count(both, inside), NEIGHBOURS)
    terms = digamma(near) + digamma(n) - digamma(counts[0]) - digamma(counts[1])
    return float(terms.mean())


def ksg_estimate(x: Any, z: Any, rng: np.random.Generator, group: Ints) -> Estimate:
    """:func:`ksg` with a 95 % interval, from how it scatters over disjoint parts of the data (Holmes and Nemenman 2019).

    ``group`` int [N] (episodes): frames of a group resemble each other, and neighbours within it would be information
    that is none. So one frame of each group is drawn, ten times, and the estimates are averaged. The variance is taken
    to fall as 1 / (number of groups). ``p`` is that of no information, one-sided; ``n`` the number of groups.
    """
    x, z = _points(x), _points(z)
    draws = [one_of_each(group, rng) for _ in range(DRAWS)]
    n = len(draws[0])
    if n < 10 * PARTS:  # in parts of fewer, the estimate has a bias that grows faster than its scatter
        return Estimate.missing(n, f"{10 * PARTS} episodes or more are needed")
    value = float(np.mean([ksg(x[rows], z[rows]) for rows in draws]))
    part_of = rng.permutation(np.arange(n) % PARTS)  # the same groups in each draw, for rows follow the groups' names
    scatter = [np.mean([ksg(x[r[part_of == k]], z[r[part_of == k]]) for r in draws]) for k in range(PARTS)]
    error = float(np.std(scatter, ddof=1) / np.sqrt(PARTS))
    half = float(stats.t.ppf(0.975, PARTS - 1)) * error
    return Estimate.between(value, value - half, value + half, n, student_p(value, error, PARTS - 1))


def one_of_each(group: Ints, rng: np.random.Generator) -> Ints:
    """The index of a row of each group, drawn at random."""
    order = rng.permutation(len(group))
    return order[np.unique(group[order], return_index=True)[1]]


def _count(points: Floats, radius: Floats) -> Ints:
    """How many points, itself among them, lie within the radius of each."""
    return KDTree(points).query_ball_point(points, radius, p=np.inf, return_length=True)


def _points(x: Any) -> Floats:
    x = np.asarray(x, np.float64)
    return x[:, None] if x.ndim == 1 else x
