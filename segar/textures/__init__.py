"""Textures: patterns that show factors, as sets of models whose differences can be measured."""

from segar.support import lazy_face

__getattr__, __dir__, __all__ = lazy_face(__name__, __file__)
