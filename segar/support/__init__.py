"""Small tools that every room may use: whole-file writes, optional packages, threads, counter-based random numbers,
elementary functions.

The room imports ``errors`` alone. Others use the names that are imported here.
"""

from segar.support.faces import lazy_face

__getattr__, __dir__, __all__ = lazy_face(__name__, __file__)
