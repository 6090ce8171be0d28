"""Recorded episodes as Minari datasets: frames, true factors and actions, and the recipe from which they follow."""

from segar.support import lazy_face

__getattr__, __dir__, __all__ = lazy_face(__name__, __file__)
