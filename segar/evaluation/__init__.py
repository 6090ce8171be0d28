"""What a policy achieves on training levels and on test levels: episodes, the generalization gap, normalised scores; recorded
actions.

The room plays policies of any framework, and knows none. Other rooms, and ``experiments``, use the names below.
"""

from segar.support import lazy_face

__getattr__, __dir__, __all__ = lazy_face(__name__, __file__)
