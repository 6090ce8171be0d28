"""Distances between two distributions: Wasserstein-2 and Kolmogorov-Smirnov, each with a bound of its error.

This module stands at the top of the room: it knows the classes of distributions, chooses a closed form or the
computation on the line, on the circle or on the plane, and serves the methods of :class:`segar.noise.Noise`. On the plane,
the Wasserstein-2 distance is computed in closed form, between atoms, or between the cells of a grid with a bound of the
error.
"""

import math
from collections.abc import Callable
from typing import Any

import numpy as np
import scipy

from segar.errors import PriorError
from segar.noise.base import DISTANCES, NODES, ROUNDING, Noise, check_width, quadrature, quantile_bends, quantile_nodes
from segar.noise.continuous import GaussianNoise, UniformNoise
from segar.noise.discrete import Deterministic, DiscreteNoise
from segar.noise.mixture import MixtureNoise
from segar.noise.transforms import Affine
from segar.noise.wrapped import Wrapped
from segar.support import Estimate, emd

FEW_ATOMS = 1024  # that stand for themselves where the other distribution has a density
FINE = 256  # cells per axis whose masses are known from the distribution function
COARSE = 32  # cells per axis that they are gathered in, for transport
REACH = 8.0  # standard deviations that are looked at of a distribution without end
ATOM_PAIRS = 4_000_000  # between which transport is solved exactly
KS_GRID = 512  # points per distribution where the difference of two distribution functions is looked at first
KS_REFINEMENTS = 40  # golden-section steps around the best of them
KS_CELLS = 200_000  # that are looked at, at most, to bound it
BISECTIONS = 60  # of a cell, at most, to bound it
TABLE = 2048  # quantiles from which the best place to cut two circles is found roughly
TURN_TOLERANCE = 1e-9  # of a turn, to which the best place to cut is searched
SEARCH_NODES = 6  # of quadrature per piece while searching


def as_noise(value: Any) -> Noise:
    """The distribution itself, or the distribution of a constant."""
    return value if isinstance(value, Noise) else Deterministic(value)


def w2_estimate(a: Noise, other: Any) -> Estimate:
    """The Wasserstein-2 distance and its error.

    The error is 0 for a closed form and for atoms; for integrals it is the change that half as many nodes make; for
    other distributions on the plane it is a bound, see :func:`w2_plane`.
    """
    b = as_noise(other)
    period = _period(a, b)
    if period is not None:
        return w2_on_circle(a, b, period)
    exact = _w2_closed(a, b)
    if exact is not None:
        return Estimate(exact)
    return w2_plane(a, b) if a.width == 2 else w2_line(a, b)


def ks_estimate(a: Noise, other: Any, tolerance: float) -> Estimate:
    """The supremum of ``|a.cdf - b.cdf|``, on the line or on the plane, and a bound of its error, which is at most the
    tolerance but on the plane and where the difference is flat.

    On the circle Kuiper's distance: the largest difference of the masses of an arc, wherever the circle is cut.
    """
    b = as_noise(other)
    period = _period(a, b)
    if a.width == 2:
        return ks_plane(a, b)
    if period is None:
        sides = supremum(a, b, tolerance), supremum(b, a, tolerance)
        value = max(side.value for side in sides)
        return Estimate(value, max(side.value + side.error for side in sides) - value)
    a, b = Wrapped(a, period), Wrapped(b, period)
    above, below = supremum(a, b, tolerance), supremum(b, a, tolerance)
    return Estimate(above.value + below.value, above.error + below.error)


DISTANCES.update(w2_estimate=w2_estimate, ks_estimate=ks_estimate)


def _period(a: Noise, b: Noise) -> float | None:
    """The period of two distributions that can be compared, None on the line and on the plane.

    Raises:
        PriorError: one is on the line and the other on the plane, or they have different periods.
    """
    if not a.width:
        check_width(a, b.width)
    check_width(b, a.width)
    periods = [one.period for one in (a, b) if one.period is not None]
    if len(set(periods)) > 1:
        raise PriorError(
            f"{a!r} and {b!r} have the periods {periods[0]:g} and {periods[1]:g}: they live on different circles"
        )
    return periods[0] if periods else None


def _w2_closed(a: Noise, b: Noise) -> float | None:
    """The distance where it has a closed form on the line and on the plane alike, None elsewhere."""
    if a == b:
        return 0.0
    for one, other in ((a, b), (b, a)):
        values, masses = one.atoms
        if len(values) == 1 and masses[0] == 1.0:  # all mass of the other goes to one point
            return float(np.sqrt(np.sum(other.var + (other.mean - values[0]) ** 2)))
    if isinstance(a, GaussianNoise) and isinstance(b, GaussianNoise) and a.clip is None and b.clip is None:
        return math.hypot(a.loc - b.loc, a.std - b.std)
    if isinstance(a, UniformNoise) and isinstance(b, UniformNoise):
        return math.hypot(a.mean - b.mean, (a.high - a.low - b.high + b.low) / math.sqrt(12))
    (base, scale, shift), (same, factor, move) = _origin(a), _origin(b)
    if base == same and scale * factor > 0:  # stretching and shifting is the gradient of a convex function
        apart = shift - move + ((scale - factor) * np.asarray(base.mean) if scale != factor else 0.0)
        return float(np.sqrt(np.sum(apart**2 + ((scale - factor) ** 2 * base.var if scale != factor else 0.0))))
    return None


def _origin(distribution: Noise) -> tuple[Noise, float, np.ndarray]:
    """The distribution, scale and shift that an affine image is made of; of any other, itself, 1 and 0."""
    scale, shift = 1.0, np.zeros(())
    while isinstance(distribution, Affine):
        scale, shift = scale * distribution.scale, shift + scale * np.asarray(distribution.shift)
        distribution = distribution.law
    return distribution, scale, shift


def w2_plane(a: Noise, b: Noise) -> Estimate:
    """The distance, and a bound of its error that is 0 for a closed form and for atoms.

    For other distributions the mass of each cell of a grid is moved into one point. The distance that it is moved is
    known, and bounds the error of the result by the triangle inequality.

    Raises:
        PriorError: a distribution says neither its atoms nor its distribution function.
    """
    if a.components is not None and b.components is not None:
        parts = [x.w2_estimate(y) for x, y in zip(a.components, b.components, strict=True)]
        return Estimate(math.hypot(*(part.value for part in parts)), math.hypot(*(part.error for part in parts)))
    if all(isinstance(one, DiscreteNoise) for one in (a, b)) and len(a.atoms[0]) * len(b.atoms[0]) <= ATOM_PAIRS:
        return Estimate(_transport(*a.atoms, *b.atoms))
    lines = [_lines(a, b, axis) for axis in range(2)]
    (x, p, moved), (y, q, also_moved) = (_points(one, *lines) for one in (a, b))
    return Estimate(_transport(x, p, y, q), moved + also_moved)


def ks_plane(a: Noise, b: Noise) -> Estimate:
    """The largest difference on the grid of both distributions' break points, exact where they are boxes and atoms; and a
    bound of how much the difference exceeds it between the points of the grid."""
    lines = [np.unique(np.concatenate([one.grid[axis] for one in (a, b)])) for axis in range(2)]
    both_sides = [np.unique(np.concatenate([line, np.nextafter(line, -np.inf)])) for line in lines]
    x = np.stack(np.meshgrid(*both_sides, indexing="ij"), axis=-1)
    value = float(np.abs(a.cdf(x) - b.cdf(x)).max())
    if _is_made_of_boxes(a) and _is_made_of_boxes(b):
        return Estimate(value)
    x, y = ([-np.inf, *line, np.inf] for line in lines)
    first, second = (one.cdf(np.stack(np.meshgrid(x, y, indexing="ij"), axis=-1)) for one in (a, b))
    bound = np.maximum(first[1:, 1:] - second[:-1, :-1], second[1:, 1:] - first[:-1, :-1])
    return Estimate(value, max(0.0, float(bound.max()) - value))


def _transport(x: np.ndarray, p: np.ndarray, y: np.ndarray, q: np.ndarray) -> float:
    """Wasserstein-2 distance between points ``(n, 2)`` with masses ``(n,)``, exact."""
    return math.sqrt(emd(((x[:, None] - y[None]) ** 2).sum(axis=-1), p, q))


def _lines(a: Noise, b: Noise, axis: int) -> np.ndarray:
    """The edges of the fine cells along one axis: the same ones for both distributions, so that their errors are alike."""
    ends = []
    for one in (a, b):
        (low, high), mean, reach = one.support[axis], one.mean[axis], REACH * math.sqrt(one.var[axis])
        ends.append((max(low, mean - reach), min(high, mean + reach)))
    low, high = min(low for low, _ in ends), max(high for _, high in ends)
    return np.linspace(low, high if high > low else low + 1.0, FINE + 1)


def _points(distribution: Noise, x: np.ndarray, y: np.ndarray) -> tuple[np.ndarray, np.ndarray, float]:
    """Points ``(n, 2)`` and masses that stand for the distribution, and a bound of their distance from it."""
    if isinstance(distribution, DiscreteNoise) and len(distribution.atoms[0]) <= FEW_ATOMS:
        return *distribution.atoms, 0.0
    mass = _masses(distribution, x, y)
    middles = [(line[1:] + line[:-1]) / 2 for line in (x, y)]
    owners = [_owners(mass.sum(axis=1 - axis)) for axis in range(2)]
    cell = (owners[0][:, None] * COARSE + owners[1]).ravel()
    weight = np.bincount(cell, mass.ravel(), COARSE**2)
    kept = weight > 0
    found, square = np.zeros((COARSE**2, 2)), 0.0
    for axis, at in enumerate(np.meshgrid(*middles, indexing="ij")):
        sums = np.bincount(cell, (mass * at).ravel(), COARSE**2)
        found[kept, axis] = sums[kept] / weight[kept]
        square += float((mass.ravel() * (at.ravel() - found[cell, axis]) ** 2).sum())
    half_a_fine_cell = 0.5 * math.hypot(x[1] - x[0], y[1] - y[0])
    return found[kept], weight[kept], math.sqrt(square) + half_a_fine_cell


def _masses(distribution: Noise, x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """Mass of each fine cell, float64 ``[FINE, FINE]``; what lies beyond the grid counts in its outermost cells."""
    if isinstance(distribution, DiscreteNoise):
        values, masses = distribution.atoms
        return np.histogram2d(*values.T, bins=[x, y], weights=masses)[0]
    x, y = (np.concatenate([[-np.inf], line[1:-1], [np.inf]]) for line in (x, y))
    below = distribution.cdf(np.stack(np.meshgrid(x, y, indexing="ij"), axis=-1))
    return np.maximum(np.diff(np.diff(below, axis=0), axis=1), 0.0)


def _owners(mass: np.ndarray) -> np.ndarray:
    """The coarse cell of each fine one along an axis: wider where there is less mass (Zador 1982: by its cube root)."""
    density = np.cbrt(mass)
    place = (np.cumsum(density) - 0.5 * density) / density.sum()
    return np.minimum((place * COARSE).astype(int), COARSE - 1)


def _is_made_of_boxes(distribution: Noise) -> bool:
    """Whether the distribution function is linear within the cells of the grid."""
    if isinstance(distribution, DiscreteNoise):
        return True
    if isinstance(distribution, MixtureNoise):
        return all(_is_made_of_boxes(part) for part in distribution.laws)
    parts = distribution.components
    return parts is not None and all(isinstance(part, (UniformNoise, DiscreteNoise)) for part in parts)


def w2_line(a: Noise, b: Noise) -> Estimate:
    """The Wasserstein-2 distance, and the change that half as many quadrature nodes make (0 for two sets of atoms)."""
    if isinstance(a, DiscreteNoise) and isinstance(b, DiscreteNoise):
        return Estimate(_integrated(a, b, 1))
    value = _integrated(a, b, NODES)
    return Estimate(value, abs(value - _integrated(a, b, NODES // 2)))


def ks_line(a: Noise, b: Noise) -> float:
    """The Kolmogorov-Smirnov distance of two distributions as distributions on the line, their periods left aside."""
    return max(greatest_difference(a, b), greatest_difference(b, a))


def greatest_difference(a: Noise, b: Noise) -> float:
    """The largest value of ``a.cdf - b.cdf`` that was found, on the line."""
    x = ks_candidates(a, b)
    gap = a.cdf(x) - b.cdf(x)
    best = int(gap.argmax())
    if isinstance(a, DiscreteNoise) and isinstance(b, DiscreteNoise):
        return max(float(gap[best]), 0.0)
    low, high = x[max(best - 1, 0)], x[min(best + 1, len(x) - 1)]
    return max(float(gap[best]), _golden_maximum(lambda t: float(a.cdf(t) - b.cdf(t)), low, high), 0.0)


def supremum(a: Noise, b: Noise, tolerance: float) -> Estimate:
    """The supremum of ``a.cdf - b.cdf`` on the line, with a bound of its error.

    Distribution functions rise, so between two points their difference is at most a's value on the right minus b's on
    the left. Cells whose bound exceeds the best value by more than the tolerance are halved.
    """
    value, excess = greatest_difference(a, b), 0.0
    edges = np.unique(np.concatenate([[-np.inf], ks_candidates(a, b), [np.inf]]))
    low, high = edges[:-1], edges[1:]
    for _ in range(BISECTIONS):
        bound = np.asarray(a.cdf(high)) - np.asarray(a.pmf(high)) - np.asarray(b.cdf(low))
        excess = max(0.0, float(bound.max()) - value)
        open_ = bound > value + tolerance
        if not open_.any() or open_.sum() > KS_CELLS:
            break
        low, high = low[open_], high[open_]
        middle = 0.5 * low + 0.5 * high
        value = max(value, float((a.cdf(middle) - b.cdf(middle)).max()))
        low, high = np.concatenate([low, middle]), np.concatenate([middle, high])
    return Estimate(value, excess)


def _integrated(a: Noise, b: Noise, nodes: int) -> float:
    """Root of the integral of the squared difference of the quantile functions; one node does where both are steps."""
    q, weight = quantile_nodes(a, b, nodes=nodes)
    return math.sqrt(float(weight @ (a.icdf(q) - b.icdf(q)) ** 2))


def ks_candidates(a: Noise, b: Noise, quantiles: int = KS_GRID) -> np.ndarray:
    """Points at which the difference of the distribution functions may be largest, ascending: where they bend or jump, just
    before jumps, and so many quantiles of each."""
    q = np.linspace(0.0, 1.0, quantiles + 2)[1:-1]
    points = [one.pieces for one in (a, b)]
    points += [one.icdf(q) for one in (a, b) if not isinstance(one, DiscreteNoise)]
    points += [np.nextafter(one.atoms[0], -np.inf) for one in (a, b)]
    return np.unique(np.concatenate(points))


def _golden_maximum(f: Callable[[float], float], low: float, high: float) -> float:
    """The largest value of a function with one peak between ``low`` and ``high``, by golden sections."""
    ratio = (math.sqrt(5) - 1) / 2
    for _ in range(KS_REFINEMENTS):
        left, right = high - ratio * (high - low), low + ratio * (high - low)
        low, high = (left, high) if f(left) < f(right) else (low, right)
    return f(0.5 * (low + high))


def w2_on_circle(a: Noise, b: Noise, period: float) -> Estimate:
    """The Wasserstein-2 distance along the shorter arcs, and the change that half as many quadrature nodes make.

    It is the least distance on the line over all ways to cut both circles, a convex function of the mass between the
    cuts (Delon, Salomon and Sobolevskii 2010).
    """
    if a == b:
        return Estimate(0.0)
    (x, p), (y, q) = a.atoms, b.atoms
    if min(p.sum(), q.sum()) > 1 - ROUNDING and len(x) * len(y) <= ATOM_PAIRS:
        apart = x[:, None] - y
        return Estimate(math.sqrt(emd((apart - period * np.rint(apart / period)) ** 2, p, q)))
    a, b = (_within_a_turn(one, period) for one in (a, b))
    near = _least(_tabulated(a, b, period), -1.5, 1.5)
    reach, shift = 2 / TABLE, math.inf
    while abs(shift - near) > 0.9 * reach:  # the minimum lies outside of what was searched
        reach *= 4
        shift = _least(lambda cut: _square(a, b, period, cut, SEARCH_NODES), near - reach, near + reach)
    # For distributions that are alike the best shift is exactly 0: beside it, a tiny weight goes round the whole circle.
    shift = min((shift, float(round(shift))), key=lambda cut: _square(a, b, period, cut, SEARCH_NODES))
    fine, coarse = (math.sqrt(_square(a, b, period, shift, nodes)) for nodes in (NODES, NODES // 2))
    return Estimate(fine, abs(fine - coarse))


def _within_a_turn(distribution: Noise, period: float) -> Noise:
    """The distribution itself where one turn holds all of it, else the wrapped one."""
    low, high = distribution.support
    return distribution if high - low <= period * (1 + 1e-12) else Wrapped(distribution, period)


def _least(f: Callable[[float], float], low: float, high: float) -> float:
    """Where a convex function is least."""
    options = {"xatol": TURN_TOLERANCE}
    return float(scipy.optimize.minimize_scalar(f, bounds=(low, high), method="bounded", options=options).x)


def _tabulated(a: Noise, b: Noise, period: float) -> Callable[[float], float]:
    """``_square`` from tables of the quantile functions."""
    q = (np.arange(TABLE) + 0.5) / TABLE
    x, y = a.icdf(q), b.icdf(q) + _whole_turns(a, b, period)
    places = np.concatenate([q - 2, q - 1, q, q + 1, q + 2])
    rolled = np.concatenate([y + period * turn for turn in (-2, -1, 0, 1, 2)])
    return lambda shift: float(np.mean((x - np.interp(q + shift, places, rolled)) ** 2))


def _square(a: Noise, b: Noise, period: float, shift: float, nodes: int) -> float:
    """The integral of (A(q) - B(q + shift))^2 over a turn, where quantile functions go on as Q(q + 1) = Q(q) + period."""
    edges = [np.array([0.0, 1.0]), quantile_bends(a), np.mod(quantile_bends(b) - shift, 1.0)]
    q, weight = quadrature(np.unique(np.concatenate(edges)), nodes)
    turns = np.floor(q + shift)
    there = b.icdf(np.clip(q + shift - turns, 0.0, 1.0)) + period * turns + _whole_turns(a, b, period)
    return float(weight @ (a.icdf(q) - there) ** 2)


def _whole_turns(a: Noise, b: Noise, period: float) -> float:
    """The shift by whole periods that brings b's support nearest to a's."""
    return period * round((a.support[0] - b.support[0]) / period)
