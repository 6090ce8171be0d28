"""Distributions of factors and locations: draws, densities, distribution functions, quantiles, moments and entropies.

The room imports ``errors`` and ``support``. Within it, modules point down to :mod:`segar.noise.base`.
"""

from segar.support import lazy_face

__getattr__, __dir__, __all__ = lazy_face(__name__, __file__)
