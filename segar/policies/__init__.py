"""Networks that act, without torch: their layers and weights as plain data, and a compiled forward pass.

Its products and sums have one order, so that actions are the same bits on every processor. The room knows no
environments. Other rooms, and ``experiments``, use the names below.
"""

from segar.support import lazy_face

__getattr__, __dir__, __all__ = lazy_face(__name__, __file__)
