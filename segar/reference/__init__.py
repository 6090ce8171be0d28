"""The reference interpreter: the same rules as plain Python, which the kernels are held against."""

from segar.support import lazy_face

__getattr__, __dir__, __all__ = lazy_face(__name__, __file__)
