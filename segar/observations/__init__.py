"""What an agent sees: states, pixels, and observations that are composed of others.

The room imports the levels, the engine and the textures. Other rooms use the names below.
"""

from segar.observations import shipped  # fills the registry
from segar.support import lazy_face

__getattr__, __dir__, __all__ = lazy_face(__name__, __file__)
