"""Numbers about laws: quantiles, moments, entropy, Wasserstein-2 and Kolmogorov-Smirnov distances.

Closed forms where there are some; else integrals by Gauss-Legendre quadrature over the laws' ``pieces``.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from segar.errors import PriorError
from segar.noise.base import Noise, gauss_legendre
from segar.noise.continuous import GaussianNoise, UniformNoise
from segar.noise.discrete import Deterministic, DiscreteNoise
from segar.support import Estimate

NODES = 24  # of Gauss-Legendre quadrature per piece: errors below 1e-10 for Gaussian pieces one sigma wide
BISECTIONS = 60  # of a piece, to find a quantile: exact to rounding
LAST_QUANTILE = 1 - 2.0**-53  # largest probability below one: the quantile of one may be infinite
KS_GRID = 512  # points per law where the difference of two distribution functions is looked at first
KS_REFINEMENTS = 40  # golden-section steps around the best of them
KS_TOLERANCE = 1e-6  # to which the Kolmogorov-Smirnov distance is bounded
KS_CELLS = 200_000  # that are looked at, at most, to bound it
PLANE_NODES = 8  # of quadrature per cell and axis of a grid on the plane
MISSING_MASS = 1e-6  # that quadrature may miss before a law counts as having mass on lines


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
    x, weight = quadrature(law.pieces)
    return float(entr(law.atoms[1]).sum() + weight @ entr(law.pdf(x)))


def w2(a: Noise, b: Noise) -> float:
    """Wasserstein-2 distance of two laws, both on the line, on one circle, or on the plane."""
    return w2_estimate(a, b).value


def w2_estimate(a: Noise, b: Noise) -> Estimate:
    """``w2`` and its error: 0 where there is a closed form or laws are atoms; for integrals what half as many nodes would
    change; for other laws on the plane a bound, see :func:`segar.noise.plane_transport.w2_plane`."""
    period = _period(a, b)
    if period is not None:
        from segar.noise.circle import w2_on_circle

        return w2_on_circle(a, b, period)
    exact = _w2_closed(a, b)
    if exact is not None:
        return Estimate(exact)
    if a.width == 2:
        from segar.noise.plane_transport import w2_plane

        return w2_plane(a, b)
    value = _w2_line(a, b, NODES)
    discrete = isinstance(a, DiscreteNoise) and isinstance(b, DiscreteNoise)
    return Estimate(value, 0.0 if discrete else abs(value - _w2_line(a, b, NODES // 2)))


def ks(a: Noise, b: Noise) -> float:
    """Kolmogorov-Smirnov distance: the supremum of ``|a.cdf - b.cdf|``, both on the line or both on the plane; on the
    circle Kuiper's, see :mod:`segar.noise.circle`."""
    period = _period(a, b)
    if period is not None:
        from segar.noise.circle import ks_on_circle

        return ks_on_circle(a, b, period)
    return _ks_plane(a, b) if a.width == 2 else ks_line(a, b)


def ks_line(a: Noise, b: Noise) -> float:
    """``ks`` of two laws on the line, their periods aside."""
    return max(greatest_difference(a, b), greatest_difference(b, a))


def ks_estimate(a: Noise, b: Noise) -> Estimate:
    """``ks`` and a bound of its error, at most 1e-6 unless the difference is flat (on the line and on the circle)."""
    period = _period(a, b)
    if period is not None:
        from segar.noise.circle import ks_estimate_on_circle

        return ks_estimate_on_circle(a, b, period)
    if a.width == 2:
        value = _ks_plane(a, b)
        return Estimate(value, _ks_excess_plane(a, b, value))
    sides = supremum(a, b), supremum(b, a)
    value = max(side.value for side in sides)
    return Estimate(value, max(side.value + side.error for side in sides) - value)


def greatest_difference(a: Noise, b: Noise) -> float:
    """The largest value of ``a.cdf - b.cdf`` that was found, on the line."""
    x = _ks_candidates(a, b)
    gap = a.cdf(x) - b.cdf(x)
    best = int(gap.argmax())
    if isinstance(a, DiscreteNoise) and isinstance(b, DiscreteNoise):
        return max(float(gap[best]), 0.0)
    low, high = x[max(best - 1, 0)], x[min(best + 1, len(x) - 1)]
    return max(float(gap[best]), _golden_maximum(lambda t: float(a.cdf(t) - b.cdf(t)), low, high), 0.0)


def supremum(a: Noise, b: Noise, tolerance: float = KS_TOLERANCE) -> Estimate:
    """The supremum of ``a.cdf - b.cdf`` on the line, with a bound of its error.

    Distribution functions rise, so between two points their difference is at most a's value on the right minus b's on
    the left. Cells whose bound exceeds the best value by more than the tolerance are halved.
    """
    value, excess = greatest_difference(a, b), 0.0
    edges = np.unique(np.concatenate([[-np.inf], _ks_candidates(a, b), [np.inf]]))
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


def _w2_closed(a: Noise, b: Noise) -> float | None:
    """The distance where it has a closed form on the line and on the plane alike, None elsewhere."""
    if a == b:
        return 0.0
    for law, other in ((a, b), (b, a)):
        values, masses = law.atoms
        if len(values) == 1 and masses[0] == 1.0:  # all of the other law goes to one point
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


def _origin(law: Noise) -> tuple[Noise, float, np.ndarray]:
    """The law, scale and shift that an affine image is made of; of another law, itself."""
    from segar.noise.transforms import Affine

    scale, shift = 1.0, np.zeros(())
    while isinstance(law, Affine):
        scale, shift = scale * law.scale, shift + scale * np.asarray(law.shift)
        law = law.law
    return law, scale, shift


def _w2_line(a: Noise, b: Noise, nodes: int) -> float:
    """The integral of the squared difference of the quantile functions; one node where both are steps."""
    discrete = isinstance(a, DiscreteNoise) and isinstance(b, DiscreteNoise)
    q, weight = _quantile_nodes(a, b, nodes=1 if discrete else nodes)
    return math.sqrt(float(weight @ (a.icdf(q) - b.icdf(q)) ** 2))


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
    (x, wx), (y, wy) = (quadrature(line, PLANE_NODES) for line in law.grid)  # type: ignore[attr-defined]
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
    q, weight = quadrature(np.unique(np.clip(np.concatenate(levels), 0.0, 1.0)), nodes)
    return np.clip(q, None, LAST_QUANTILE), weight


def quadrature(edges: np.ndarray, nodes: int = NODES) -> tuple[np.ndarray, np.ndarray]:
    """Gauss-Legendre nodes and weights on each interval between ascending ``edges``, flat."""
    z, weight = gauss_legendre(nodes)
    half, middle = np.diff(edges) / 2, (edges[1:] + edges[:-1]) / 2
    return (middle[:, None] + half[:, None] * z).ravel(), (half[:, None] * weight).ravel()


def _period(a: Noise, b: Noise) -> float | None:
    """The period of two laws that can be compared, None on the line and on the plane."""
    if not a.width:
        _check_width(a, b.width)
    _check_width(b, a.width)
    if a.period is b.period is None:
        return None
    from segar.noise.circle import common_period

    return common_period(a, b)


def _check_width(law: Noise, width: int) -> None:
    if law.width != width or not width:
        place = {0: "among things that are not numbers", 1: "on the line", 2: "on the plane"}
        raise PriorError(f"{law!r} is a law {place[law.width]}; here one {place[width or 1]} is needed")
