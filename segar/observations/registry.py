"""Observations by their names. Importing :mod:`segar.observations` fills the registry with those that come with SEGAR."""

from collections.abc import Callable

from segar.observations.protocol import Observation

OBSERVATIONS: dict[str, Callable[..., Observation]] = {}
"""Name to the class or function that makes the observation from its options."""
