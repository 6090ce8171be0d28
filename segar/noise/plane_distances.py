"""Wasserstein-2 and Kolmogorov-Smirnov distances of distributions on the plane.

The first is computed in closed form, between atoms, or between the cells of a grid with a bound of the error.
"""

import math
from typing import Any

import numpy as np

from segar.noise.base import Noise
from segar.noise.continuous import UniformNoise
from segar.noise.discrete import DiscreteNoise
from segar.noise.locations import GaussianNoise2D
from segar.noise.mixture import MixtureNoise
from segar.support import Estimate, emd

ATOM_PAIRS = 4_000_000  # between which transport is solved exactly
FEW_ATOMS = 1024  # that stand for themselves where the other distribution has a density
FINE = 256  # cells per axis whose masses are known from the distribution function
COARSE = 32  # cells per axis that they are gathered in, for transport
REACH = 8.0  # standard deviations that are looked at of a distribution without end


def w2_plane(a: Noise, b: Noise) -> Estimate:
    """The distance, and a bound of its error that is 0 for a closed form and for atoms.

    For other distributions the mass of each cell of a grid is moved into one point. The distance that it is moved is
    known, and bounds the error of the result by the triangle inequality.

    Raises:
        PriorError: a distribution says neither its atoms nor its distribution function.
    """
    if isinstance(a, GaussianNoise2D) and isinstance(b, GaussianNoise2D) and a.clip is None and b.clip is None:
        return Estimate(_gaussians(a, b))
    if a.components is not None and b.components is not None:
        parts = [x.w2_estimate(y) for x, y in zip(a.components, b.components, strict=True)]
        return Estimate(math.hypot(*(part.value for part in parts)), math.hypot(*(part.error for part in parts)))
    if all(isinstance(one, DiscreteNoise) for one in (a, b)) and len(a.atoms[0]) * len(b.atoms[0]) <= ATOM_PAIRS:
        return Estimate(_transport(*a.atoms, *b.atoms))
    lines = [_lines(a, b, axis) for axis in range(2)]
    (x, p, moved), (y, q, also_moved) = (_points(one, *lines) for one in (a, b))
    return Estimate(_transport(x, p, y, q), moved + also_moved)


def ks_plane(a: Noise, b: Noise) -> float:
    """The largest difference on the grid of both distributions' break points; exact where they are boxes and atoms."""
    grid = []
    for axis in range(2):
        points = np.concatenate([one.grid[axis] for one in (a, b)])
        grid.append(np.unique(np.concatenate([points, np.nextafter(points, -np.inf)])))
    x = np.stack(np.meshgrid(*grid, indexing="ij"), axis=-1)
    return float(np.abs(a.cdf(x) - b.cdf(x)).max())


def ks_plane_estimate(a: Noise, b: Noise) -> Estimate:
    """``ks_plane``, and a bound of how much the difference exceeds it between the points of the grid."""
    value = ks_plane(a, b)
    if _is_made_of_boxes(a) and _is_made_of_boxes(b):
        return Estimate(value)
    lines = [np.unique(np.concatenate([one.grid[axis] for one in (a, b)])) for axis in range(2)]
    x, y = ([-np.inf, *line, np.inf] for line in lines)
    first, second = (one.cdf(np.stack(np.meshgrid(x, y, indexing="ij"), axis=-1)) for one in (a, b))
    bound = np.maximum(first[1:, 1:] - second[:-1, :-1], second[1:, 1:] - first[:-1, :-1])
    return Estimate(value, max(0.0, float(bound.max()) - value))


def _gaussians(a: Any, b: Any) -> float:
    """Closed form (Dowson and Landau 1982): |m1-m2|^2 + tr(A + B - 2 (B^1/2 A B^1/2)^1/2)."""
    first, second = np.array(a.cov), np.array(b.cov)
    values, vectors = np.linalg.eigh(second)
    root = (vectors * np.sqrt(np.clip(values, 0, None))) @ vectors.T
    cross = np.sqrt(np.clip(np.linalg.eigvalsh(root @ first @ root), 0, None)).sum()
    square = np.sum((np.array(a.loc) - np.array(b.loc)) ** 2) + np.trace(first) + np.trace(second) - 2 * cross
    return math.sqrt(max(float(square), 0.0))


def _transport(x: np.ndarray, p: np.ndarray, y: np.ndarray, q: np.ndarray) -> float:
    """Wasserstein-2 distance between points ``(n, 2)`` with masses ``(n,)``, exact."""
    return math.sqrt(emd(((x[:, None] - y[None]) ** 2).sum(axis=-1), p / p.sum(), q / q.sum()))


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
