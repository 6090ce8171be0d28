"""Distances between two distributions: Wasserstein-2 and Kolmogorov-Smirnov, each with a bound of its error.

This module stands at the top of the room: it knows the classes of distributions, chooses a closed form or the
computation on the line, on the circle or on the plane, and serves the methods of :class:`segar.noise.Noise`.
"""

import math
from typing import Any

import numpy as np

from segar.errors import PriorError
from segar.noise.base import DISTANCES, Noise, check_width
from segar.noise.circle_distances import ks_estimate_on_circle, ks_on_circle, w2_on_circle
from segar.noise.continuous import GaussianNoise, UniformNoise
from segar.noise.discrete import Deterministic
from segar.noise.line_distances import ks_line, ks_line_estimate, w2_line
from segar.noise.plane_distances import ks_plane, ks_plane_estimate, w2_plane
from segar.noise.transforms import Affine
from segar.support import Estimate


def as_noise(value: Any) -> Noise:
    """The distribution itself, or the distribution of a constant."""
    return value if isinstance(value, Noise) else Deterministic(value)


def w2_estimate(a: Noise, other: Any) -> Estimate:
    """The Wasserstein-2 distance and its error.

    The error is 0 for a closed form and for atoms; for integrals it is the change that half as many nodes make; for
    other distributions on the plane it is a bound, see :func:`segar.noise.plane_distances.w2_plane`.
    """
    b = as_noise(other)
    period = _period(a, b)
    if period is not None:
        return w2_on_circle(a, b, period)
    exact = _w2_closed(a, b)
    if exact is not None:
        return Estimate(exact)
    return w2_plane(a, b) if a.width == 2 else w2_line(a, b)


def ks(a: Noise, other: Any) -> float:
    """The supremum of ``|a.cdf - b.cdf|``, on the line or on the plane; on the circle Kuiper's distance."""
    b = as_noise(other)
    period = _period(a, b)
    if period is not None:
        return ks_on_circle(a, b, period)
    return ks_plane(a, b) if a.width == 2 else ks_line(a, b)


def ks_estimate(a: Noise, other: Any) -> Estimate:
    """``ks`` and a bound of its error, at most 1e-6 on the line and on the circle unless the difference is flat."""
    b = as_noise(other)
    period = _period(a, b)
    if period is not None:
        return ks_estimate_on_circle(a, b, period)
    return ks_plane_estimate(a, b) if a.width == 2 else ks_line_estimate(a, b)


DISTANCES.update(w2_estimate=w2_estimate, ks=ks, ks_estimate=ks_estimate)


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
