"""The built-in rules, plain typed functions, and the world that they make: no numba, no engine."""

from segar.support import lazy_face

__getattr__, __dir__, __all__ = lazy_face(__name__, __file__)
