"""How hard levels are, what can be done in them, and how alike they are in that; and situations, in which worlds are
compared: all without training."""

from segar.support import lazy_face

__getattr__, __dir__, __all__ = lazy_face(__name__, __file__)
