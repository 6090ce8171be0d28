"""The lab: an agent experiments in a world whose rules are hidden, and its answer is graded by distances between dynamics.

The room plays levels by given actions. Other rooms use the names below.
"""

from segar.support import lazy_face

__getattr__, __dir__, __all__ = lazy_face(__name__, __file__)
