"""Distances between level sets and distributions, and measures of single level sets, all without any training.

The room imports ``levels``, ``textures`` and the rooms below them, and never the engine. Others use the names that are
imported here; each measure names its options and its source in its docstring.
"""

from segar.support import lazy_face

__getattr__, __dir__, __all__ = lazy_face(__name__, __file__)
