"""Worlds as pages: levels, physics, observations and policies in one file that a browser plays, with the bits of Python.

The room imports ``engine``, ``envs``, ``evaluation``, ``policies`` and what lies below them. Other rooms use the names
that are imported here.
"""

from segar.support import lazy_face

__getattr__, __dir__, __all__ = lazy_face(__name__, __file__)
