"""Distributions of factors and locations: draws, densities, distribution functions, entropies and distances.

The room imports ``errors`` and ``support``. Within it, modules point from :mod:`segar.noise.distances`, which knows all
classes, down to :mod:`segar.noise.base`.
"""

from segar.noise.base import Noise
from segar.noise.continuous import GaussianNoise, LogUniform, UniformNoise
from segar.noise.discrete import Bernoulli, Choice, Deterministic, DiscreteRangeNoise, Empirical
from segar.noise.distances import as_noise
from segar.noise.line_distances import ks_line
from segar.noise.locations import (
    CenterLocation,
    GaussianNoise2D,
    Independent,
    RandomBottomLeftLocation,
    RandomBottomLocation,
    RandomBottomRightLocation,
    RandomEdgeLocation,
    RandomLeftLocation,
    RandomMiddleLocation,
    RandomRightLocation,
    RandomTopLeftLocation,
    RandomTopLocation,
    RandomTopRightLocation,
    RandomUniformLocation,
)
from segar.noise.mixture import GaussianMixtureNoise, Mixture, MixtureNoise
from segar.noise.transforms import Affine
from segar.noise.truncated import TruncatedGaussianNoise
from segar.noise.wrapped import VonMises, Wrapped, wrap

__all__ = [
    "Affine", "Bernoulli", "CenterLocation", "Choice", "Deterministic", "DiscreteRangeNoise", "Empirical",
    "GaussianMixtureNoise", "GaussianNoise", "GaussianNoise2D", "Independent", "LogUniform", "Mixture", "MixtureNoise", "Noise",
    "RandomBottomLeftLocation", "RandomBottomLocation", "RandomBottomRightLocation", "RandomEdgeLocation",
    "RandomLeftLocation", "RandomMiddleLocation", "RandomRightLocation", "RandomTopLeftLocation", "RandomTopLocation",
    "RandomTopRightLocation", "RandomUniformLocation", "TruncatedGaussianNoise", "UniformNoise", "VonMises",
    "Wrapped",
]  # fmt: skip
