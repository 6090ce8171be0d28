"""Recorded episodes: frames, true factors and actions, for offline learning and for the study of representations."""

from segar.support import lazy_face

__getattr__, __dir__, __all__ = lazy_face(__name__, __file__)
