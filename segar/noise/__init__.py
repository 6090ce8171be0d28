"""Distributions of factors and locations: draws, densities, distribution functions, entropies and distances.

The room imports ``errors`` and ``support``. Within it, modules point from :mod:`segar.noise.distances`, which knows all
classes, down to :mod:`segar.noise.base`.
"""

from segar.noise import distances  # gives Noise.w2 and Noise.ks what they call
from segar.support import lazy_face

__getattr__, __dir__, __all__ = lazy_face(__name__, __file__)
