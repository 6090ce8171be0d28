"""Laws of chance for factors and locations: sampled, and asked for density, cdf, entropy and distances."""

from segar.noise.continuous import GaussianNoise, LogUniform, UniformNoise
from segar.noise.discrete import Bernoulli, Choice, Deterministic, DiscreteRangeNoise
from segar.noise.law import Noise
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
from segar.noise.mixture import GaussianMixtureNoise, Mixture

__all__ = [
    "Bernoulli",
    "CenterLocation",
    "Choice",
    "Deterministic",
    "DiscreteRangeNoise",
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
    "UniformNoise",
]
