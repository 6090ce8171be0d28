"""The settings of a run: dataclasses in which every default lives once, and the errors that users see.

It may import segar. For authors of algorithms: a sub-class of :class:`AlgorithmConfig`, or of an algorithm's own class such
as :class:`PPOConfig`, holds the settings of an algorithm of your own, and names the class that learns.
"""

from segar.support import lazy_face

__getattr__, __dir__, __all__ = lazy_face(__name__, __file__)
