"""Laws of chance for factors and locations: sampled, and asked for density, cdf, entropy and distances."""

from segar.noise.angles import VonMises
from segar.noise.base import Noise
from segar.noise.circle import Wrapped, wrap
from segar.noise.continuous import GaussianNoise, LogUniform, UniformNoise
from segar.noise.discrete import Bernoulli, Choice, Deterministic, DiscreteRangeNoise, Empirical
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
from segar.noise.measures import as_noise, ks_line
from segar.noise.mixture import GaussianMixtureNoise, Mixture
from segar.noise.transforms import Affine
from segar.noise.truncated import TruncatedGaussianNoise

__all__ = [
    "Affine",
    "Bernoulli",
    "CenterLocation",
    "Choice",
    "Deterministic",
    "DiscreteRangeNoise",
    "Empirical",
    "GaussianMixtureNoise",
    "GaussianNoise",
    "GaussianNoise2D",
    "Independent",
    "LogUniform",
    "Mixture",
    "Noise",
    "RandomBottomLeftLocation",
    "RandomBottomLocation",
    "RandomBottomRightLocation",
    "RandomEdgeLocation",
    "RandomLeftLocation",
    "RandomMiddleLocation",
    "RandomRightLocation",
    "RandomTopLeftLocation",
    "RandomTopLocation",
    "RandomTopRightLocation",
    "RandomUniformLocation",
    "TruncatedGaussianNoise",
    "UniformNoise",
    "VonMises",
    "Wrapped",
    "as_noise",
    "ks_line",
    "wrap",
]
