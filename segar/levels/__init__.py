"""Levels, the distributions that they are sampled from, and the probabilities and entropies of these distributions.

The room imports ``errors``, ``support``, ``language``, ``rules`` and ``noise``. ``sampling`` draws levels,
``probability`` computes what is known without sampling; others use the names that are imported here.
"""

from segar.support import lazy_face

__getattr__, __dir__, __all__ = lazy_face(__name__, __file__)
