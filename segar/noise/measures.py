"""Numbers about laws: quantiles, moments, entropy, Wasserstein-2 and Kolmogorov-Smirnov distances.

Closed forms where there are some; else integrals by Gauss-Legendre quadrature over the laws' ``pieces``.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from segar.errors import PriorError
from segar.estimates import Estimate
from segar.noise.continuous import GaussianNoise, UniformNoise
from segar.noise.discrete import Deterministic, DiscreteNoise
from segar.noise.law import Noise

NODES = 24  # of Gauss-Legendre quadrature per piece: errors below 1e-10 for Gaussian pieces one sigma wide
BISECTIONS = 60  # of a piece, to find a quantile: exact to rounding
LAST_QUANTILE = 1 - 2.0**-53  # largest probability below one: the quantile of one may be infinite
KS_GRID = 512  # points per law where the difference of two distribution functions is looked at first
KS_REFINEMENTS = 40  # golden-section steps around the best of them
KS_TOLERANCE = 1e-6  # to which the Kolmogorov-Smirnov distance is bounded
KS_CELLS = 200_000  # that are looked at, at most, to bound it
PLANE_NODES = 8  # of quadrature per cell and axis of a grid on the plane
MISSING_MASS = 1e-6  # that quadrature may miss before a law counts as having mass on lines
TRANSPORT_PAIRS = 4_000_000  # of atoms of two laws on the plane, between which transport is solved exactly
TRANSPORT_STEPS = 10_000_000  # of the network simplex, at most
ASSIGNMENT_POINTS = 1024  # per law, where two laws on the plane have no closed form


def as_noise(value: Any) -> Noise:
    """The law itself, or the law of a constant."""
    return value if isinstance(value, Noise) else Deterministic(value)


def invert_cdf(law: Noise, q: Any) -> Any:
    """Quantiles of a law on the line by bisection of its ``cdf``."""
    _check_width(law, 1)
    q = np.asarray(q, dtype=float)
    grid = law.pieces
    level = np.asarray(law.cdf(grid))
    right = np.clip(np.searchsorted(level, q, side="left"), 0, len(grid) - 1)
    low, high = grid[np.maximum(right - 1, 0)].copy(), grid[right].copy()
    for _ in range(BISECTIONS):
        middle = 0.5 * (low + high)
        reached = law.cdf(middle) >= q
        high = np.where(reached, middle, high)
        low = np.where(reached, low, middle)
    return np.where((q >= 0) & (q <= 1), high, np.nan)[()]


def moments(law: Noise) -> tuple[Any, Any]:
    """Mean and variance of a law on the line."""
    _check_width(law, 1)
    q, weight = _quantile_nodes(law)
    x = law.icdf(q)
    mean = float(weight @ x)
    return mean, float(weight @ (x - mean) ** 2)


def entropy(law: Noise) -> float:
    """Entropy of a law: of its atoms, plus that of its density.

    Raises:
        PriorError: a law on the plane has mass on lines, where it has neither atoms nor a density.
    """
    from scipy.special import entr

    if law.width == 2:
        return _entropy_plane(law)
    _check_width(law, 1)
    x, weight = _nodes(law.pieces)
    return float(entr(law.atoms[1]).sum() + weight @ entr(law.pdf(x)))


def w2(a: Noise, b: Noise) -> float:
    """Wasserstein-2 distance of two laws, both on the line or both on the plane."""
    _check_same_width(a, b)
    if a == b:
        return 0.0
    for law, other in ((a, b), (b, a)):
        if isinstance(law, Deterministic):
            return float(np.sqrt(np.sum(other.var + (other.mean - np.asarray(law.value)) ** 2)))
    if a.width == 2:
        return _w2_plane(a, b)
    if isinstance(a, GaussianNoise) and isinstance(b, GaussianNoise) and a.clip is None and b.clip is None:
        return math.hypot(a.loc - b.loc, a.std - b.std)
    if isinstance(a, UniformNoise) and isinstance(b, UniformNoise):
        return math.hypot(a.mean - b.mean, (a.high - a.low - b.high + b.low) / math.sqrt(12))
    return _w2_line(a, b, NODES)


def w2_estimate(a: Noise, b: Noise) -> Estimate:
    """``w2`` and its error.

    Zero where there is a closed form or laws are atoms; for integrals on the line what half as many nodes would change;
    for laws on the plane that are matched by draws the sum of the distances between two sets of draws of each law,
    which exceeds the distances of draws to their law, and so by the triangle inequality the error (both in the mean).
    """
    value = w2(a, b)
    if a == b or any(isinstance(law, Deterministic) for law in (a, b)):
        return Estimate(value)
    if a.width == 2:
        return Estimate(value, _w2_error_plane(a, b))
    kinds = {type(a), type(b)}
    if kinds == {UniformNoise} or (kinds == {GaussianNoise} and a.clip is None and b.clip is None):  # type: ignore[attr-defined]
        return Estimate(value)
    discrete = isinstance(a, DiscreteNoise) and isinstance(b, DiscreteNoise)
    return Estimate(value, 0.0 if discrete else abs(value - _w2_line(a, b, NODES // 2)))


def ks(a: Noise, b: Noise) -> float:
    """Kolmogorov-Smirnov distance: the supremum of ``|a.cdf - b.cdf|``, both on the line or both on the plane."""
    _check_same_width(a, b)
    if a.width == 2:
        return _ks_plane(a, b)
    x = _ks_candidates(a, b)
    gap = np.abs(a.cdf(x) - b.cdf(x))
    if isinstance(a, DiscreteNoise) and isinstance(b, DiscreteNoise):
        return float(gap.max())
    best = int(gap.argmax())
    low, high = x[max(best - 1, 0)], x[min(best + 1, len(x) - 1)]
    return max(float(gap[best]), _golden_maximum(lambda t: abs(float(a.cdf(t) - b.cdf(t))), low, high))


def ks_estimate(a: Noise, b: Noise, tolerance: float = KS_TOLERANCE) -> Estimate:
    """``ks`` and a bound of its error, at most ``tolerance`` unless the difference is flat (on the line).

    Distribution functions rise, so between two points their difference is at most the greater one's value on the right
    minus the other's on the left. Cells whose bound exceeds the best value by more than the tolerance are halved.
    """
    value = ks(a, b)
    if a.width == 2:
        return Estimate(value, _ks_excess_plane(a, b, value))
    edges = np.unique(np.concatenate([[-np.inf], _ks_candidates(a, b), [np.inf]]))
    low, high = edges[:-1], edges[1:]
    excess = 0.0
    for _ in range(BISECTIONS):
        bound = _ks_bound(a, b, low, high)
        excess = max(0.0, float(bound.max()) - value)
        open_ = bound > value + tolerance
        if not open_.any() or open_.sum() > KS_CELLS:
            break
        low, high = low[open_], high[open_]
        middle = 0.5 * low + 0.5 * high
        value = max(value, float(np.abs(a.cdf(middle) - b.cdf(middle)).max()))
        low, high = np.concatenate([low, middle]), np.concatenate([middle, high])
    return Estimate(value, excess)


def _ks_bound(a: Noise, b: Noise, low: np.ndarray, high: np.ndarray) -> np.ndarray:
    """Upper bounds of the difference of two distribution functions on cells ``[low, high)``."""
    right = [np.asarray(law.cdf(high)) - np.asarray(law.pmf(high)) for law in (a, b)]
    left = [np.asarray(law.cdf(low)) for law in (a, b)]
    return np.maximum(right[0] - left[1], right[1] - left[0])


def _ks_excess_plane(a: Noise, b: Noise, value: float) -> float:
    """By how much the difference on the plane may exceed what the grid shows; zero where it is linear within cells."""
    if all(_is_made_of_boxes(law) for law in (a, b)):
        return 0.0
    lines = [np.unique(np.concatenate([law.grid[axis] for law in (a, b)])) for axis in range(2)]  # type: ignore[attr-defined]
    x, y = ([-np.inf, *line, np.inf] for line in lines)
    first, second = (law.cdf(np.stack(np.meshgrid(x, y, indexing="ij"), axis=-1)) for law in (a, b))
    bound = np.maximum(first[1:, 1:] - second[:-1, :-1], second[1:, 1:] - first[:-1, :-1])
    return max(0.0, float(bound.max()) - value)


def _is_made_of_boxes(law: Noise) -> bool:
    if isinstance(law, DiscreteNoise):
        return True
    parts = getattr(law, "laws", None)
    if parts is not None:
        return all(_is_made_of_boxes(part) for part in parts)
    parts = getattr(law, "components", None)
    return parts is not None and all(isinstance(part, (UniformNoise, DiscreteNoise)) for part in parts)


def _w2_line(a: Noise, b: Noise, nodes: int) -> float:
    """The integral of the squared difference of the quantile functions; one node where both are steps."""
    discrete = isinstance(a, DiscreteNoise) and isinstance(b, DiscreteNoise)
    q, weight = _quantile_nodes(a, b, nodes=1 if discrete else nodes)
    return math.sqrt(float(weight @ (a.icdf(q) - b.icdf(q)) ** 2))


def _w2_plane(a: Noise, b: Noise) -> float:
    from segar.noise.locations import GaussianNoise2D

    if isinstance(a, GaussianNoise2D) and isinstance(b, GaussianNoise2D) and a.clip is None and b.clip is None:
        return _w2_gaussians(a, b)
    first, second = getattr(a, "components", None), getattr(b, "components", None)
    if first is not None and second is not None:
        return math.hypot(*(w2(x, y) for x, y in zip(first, second, strict=True)))
    if _few_atoms(a, b):
        return _w2_of_atoms(a, b)
    return _w2_by_assignment(a, b)


def _w2_error_plane(a: Noise, b: Noise) -> float:
    from segar.noise.locations import GaussianNoise2D

    gaussian = all(isinstance(law, GaussianNoise2D) and law.clip is None for law in (a, b))
    parts = [getattr(law, "components", None) for law in (a, b)]
    if parts[0] is not None and parts[1] is not None:
        return math.hypot(*(w2_estimate(x, y).error for x, y in zip(*parts, strict=True)))
    if gaussian or _few_atoms(a, b):
        return 0.0
    return sum(_w2_by_assignment(law, law, seeds=(0, 1)) for law in (a, b))


def _few_atoms(a: Noise, b: Noise) -> bool:
    atoms = isinstance(a, DiscreteNoise) and isinstance(b, DiscreteNoise)
    return atoms and len(a.atoms[0]) * len(b.atoms[0]) <= TRANSPORT_PAIRS


def _w2_of_atoms(a: Noise, b: Noise) -> float:
    """Optimal transport between atoms, exact."""
    import ot  # POT is loaded on first use

    (x, p), (y, q) = a.atoms, b.atoms
    cost = ((x[:, None] - y[None]) ** 2).sum(axis=-1)
    return math.sqrt(max(float(ot.emd2(p / p.sum(), q / q.sum(), cost, numItermax=TRANSPORT_STEPS)), 0.0))  # type: ignore[arg-type]


def _w2_gaussians(a: Any, b: Any) -> float:
    """Closed form (Dowson and Landau 1982): |m1-m2|^2 + tr(A + B - 2 (B^1/2 A B^1/2)^1/2)."""
    first, second = np.array(a.cov), np.array(b.cov)
    values, vectors = np.linalg.eigh(second)
    root = (vectors * np.sqrt(np.clip(values, 0, None))) @ vectors.T
    cross = np.sqrt(np.clip(np.linalg.eigvalsh(root @ first @ root), 0, None)).sum()
    square = np.sum((np.array(a.loc) - np.array(b.loc)) ** 2) + np.trace(first) + np.trace(second) - 2 * cross
    return math.sqrt(max(float(square), 0.0))


def _w2_by_assignment(a: Noise, b: Noise, seeds: tuple[int, int] = (0, 0)) -> float:
    """Optimal matching of 1024 seeded draws of each law: too large by a few hundredths of the laws' spread."""
    from scipy.optimize import linear_sum_assignment

    x, y = (law.sample(np.random.default_rng(s), ASSIGNMENT_POINTS) for law, s in zip((a, b), seeds, strict=True))
    cost = ((x[:, None] - y[None]) ** 2).sum(axis=-1)
    return math.sqrt(float(cost[linear_sum_assignment(cost)].mean()))


def _ks_plane(a: Noise, b: Noise) -> float:
    """Largest gap on the grid of both laws' break points; exact for laws that are made of boxes and atoms."""
    grid = []
    for axis in range(2):
        points = np.concatenate([law.grid[axis] for law in (a, b)])  # type: ignore[attr-defined]
        grid.append(np.unique(np.concatenate([points, np.nextafter(points, -np.inf)])))
    x = np.stack(np.meshgrid(*grid, indexing="ij"), axis=-1)
    return float(np.abs(a.cdf(x) - b.cdf(x)).max())


def _ks_candidates(a: Noise, b: Noise) -> np.ndarray:
    q = np.linspace(0.0, 1.0, KS_GRID + 2)[1:-1]
    points = [law.pieces for law in (a, b)]
    points += [law.icdf(q) for law in (a, b) if not isinstance(law, DiscreteNoise)]
    points += [np.nextafter(law.atoms[0], -np.inf) for law in (a, b)]
    return np.unique(np.concatenate(points))


def _golden_maximum(f: Any, low: float, high: float) -> float:
    ratio = (math.sqrt(5) - 1) / 2
    for _ in range(KS_REFINEMENTS):
        left, right = high - ratio * (high - low), low + ratio * (high - low)
        low, high = (left, high) if f(left) < f(right) else (low, right)
    return f(0.5 * (low + high))


def _entropy_plane(law: Noise) -> float:
    """Of atoms, plus the integral of the density over the cells of the law's grid."""
    from scipy.special import entr

    masses = law.atoms[1]
    (x, wx), (y, wy) = (_nodes(line, PLANE_NODES) for line in law.grid)  # type: ignore[attr-defined]
    density = law.pdf(np.stack(np.meshgrid(x, y, indexing="ij"), axis=-1))
    missing = 1.0 - masses.sum() - wx @ density @ wy
    if abs(missing) > MISSING_MASS:
        raise PriorError(f"{law!r}: {missing:.3g} of its mass lies on lines, where entropy has no common unit")
    return float(entr(masses).sum() + wx @ entr(density) @ wy)


def _quantile_nodes(*laws: Noise, nodes: int = NODES) -> tuple[np.ndarray, np.ndarray]:
    """Nodes and weights on (0, 1) between the probabilities at which some law's quantile function may bend or jump."""
    levels = [np.array([0.0, 1.0])]
    for law in laws:
        p = np.asarray(law.cdf(law.pieces), dtype=float)
        levels += [p, p - law.pmf(law.pieces)]
    q, weight = _nodes(np.unique(np.clip(np.concatenate(levels), 0.0, 1.0)), nodes)
    return np.clip(q, None, LAST_QUANTILE), weight


def _nodes(edges: np.ndarray, nodes: int = NODES) -> tuple[np.ndarray, np.ndarray]:
    """Gauss-Legendre nodes and weights on each interval between ascending ``edges``, flat."""
    z, weight = np.polynomial.legendre.leggauss(nodes)
    half, middle = np.diff(edges) / 2, (edges[1:] + edges[:-1]) / 2
    return (middle[:, None] + half[:, None] * z).ravel(), (half[:, None] * weight).ravel()


def _check_same_width(a: Noise, b: Noise) -> None:
    if not a.width:
        _check_width(a, b.width)
    _check_width(b, a.width)


def _check_width(law: Noise, width: int) -> None:
    if law.width != width or not width:
        place = {0: "among things that are not numbers", 1: "on the line", 2: "on the plane"}
        raise PriorError(f"{law!r} is a law {place[law.width]}; here one {place[width or 1]} is needed")
