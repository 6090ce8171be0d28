"""Worlds as pages: levels, physics, observations and policies in one file that a browser plays, with the bits of Python.

The room imports ``engine``, ``envs``, ``evaluation``, ``policies`` and what lies below them. Other rooms use the names
that are imported here.
"""

from segar.playground.page import Playground, make_playground
from segar.playground.policy import WEIGHTS
from segar.playground.run_folder import RunPolicy, read_policy
from segar.playground.studio import Studio

__all__ = ["WEIGHTS", "Playground", "RunPolicy", "Studio", "make_playground", "read_policy"]
