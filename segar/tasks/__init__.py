"""The built-in tasks, and tasks by name."""

from segar.language import set_default_task
from segar.support import lazy_face

__getattr__, __dir__, __all__ = lazy_face(__name__, __file__)

set_default_task(lambda: __getattr__("puttputt")())  # which is loaded when it is asked for
