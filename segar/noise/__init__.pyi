from . import locations
from .base import Noise
from .continuous import GaussianNoise, LogUniform, TruncatedGaussianNoise, UniformNoise
from .discrete import Bernoulli, Choice, Deterministic, DiscreteRangeNoise, Empirical
from .distances import as_noise as as_noise, ks_candidates as ks_candidates, ks_line as ks_line
from .locations import (
    CenterLocation as CenterLocation,
    GaussianNoise2D,
    Independent,
    RandomBottomLeftLocation as RandomBottomLeftLocation,
    RandomBottomLocation,
    RandomBottomRightLocation as RandomBottomRightLocation,
    RandomEdgeLocation,
    RandomLeftLocation as RandomLeftLocation,
    RandomMiddleLocation,
    RandomRightLocation as RandomRightLocation,
    RandomTopLeftLocation as RandomTopLeftLocation,
    RandomTopLocation,
    RandomTopRightLocation as RandomTopRightLocation,
    RandomUniformLocation,
)
from .mixture import GaussianMixtureNoise, Mixture, MixtureNoise as MixtureNoise
from .transforms import Affine
from .wrapped import VonMises, Wrapped, wrap as wrap

__all__ = [
    "Affine", "Bernoulli", "Choice", "Deterministic", "DiscreteRangeNoise", "Empirical", "GaussianMixtureNoise",
    "GaussianNoise", "GaussianNoise2D", "Independent", "LogUniform", "Mixture", "Noise", "RandomBottomLocation",
    "RandomEdgeLocation", "RandomMiddleLocation", "RandomTopLocation", "RandomUniformLocation",
    "TruncatedGaussianNoise", "UniformNoise", "VonMises", "Wrapped", "locations",
]  # fmt: skip
