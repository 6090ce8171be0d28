"""Suites: pairs of level distributions with frozen test levels, on which methods are compared. Each is data: a text file, the
levels of its test, and the plans that solve them, all with their hashes.

The room imports ``evaluation``, ``tasks`` and what lies below them.
"""

from segar.support import lazy_face

__getattr__, __dir__, __all__ = lazy_face(__name__, __file__)
