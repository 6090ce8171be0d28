"""Templates: functions that make options of a rule space, plain typed functions with constants; and the built-in space."""

from segar.support import lazy_face

__getattr__, __dir__, _ = lazy_face(__name__, __file__)
