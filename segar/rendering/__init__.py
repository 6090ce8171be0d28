"""Pictures for people: frames, windows, videos.

The room draws states; it knows no environments. It imports the engine's states and the colours of the observations.
"""

from segar.support import lazy_face

__getattr__, __dir__, __all__ = lazy_face(__name__, __file__)
