"""Observations by their names. Importing :mod:`segar.observations` fills the registry with those that come with SEGAR."""

from collections.abc import Callable

from segar.errors import SegarError, did_you_mean
from segar.observations.protocol import Observation

OBSERVATIONS: dict[str, Callable[..., Observation]] = {}
"""Name to the class or function that makes the observation from its options."""


def observation_named(name: str) -> Observation:
    """The observation of this name with its default options.

    Raises:
        SegarError: no observation has this name.
    """
    if name not in OBSERVATIONS:
        raise SegarError(f"no observation is called '{name}'.{did_you_mean(name, OBSERVATIONS)}")
    return OBSERVATIONS[name]()
