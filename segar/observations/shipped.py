"""The observations that have a name: those that come with SEGAR."""

from collections.abc import Callable
from typing import Any

from segar.observations.composed.stack import Stack
from segar.observations.pixels.solid_colours import Pixels
from segar.observations.pixels.textured import TexturedPixels
from segar.observations.protocol import Observation
from segar.observations.registry import OBSERVATIONS
from segar.observations.state.state_vector import StateVector


def state_normalised(normalise: bool = True, **options: Any) -> StateVector:
    """A state vector in units of the prior; options are those of :class:`StateVector`."""
    return StateVector(normalise=normalise, **options)


def rgb_stack2(n: int = 2, **options: Any) -> Stack:
    """The last two frames, which show positions and velocities; options are those of :class:`Pixels`."""
    return Stack(Pixels(**options), n)


def rgb_stack4(n: int = 4, **options: Any) -> Stack:
    """The last four frames; options are those of :class:`Pixels`."""
    return Stack(Pixels(**options), n)


def textures_stack4(n: int = 4, **options: Any) -> Stack:
    """The last four frames in textures; options are those of :class:`TexturedPixels`."""
    return Stack(TexturedPixels(**options), n)


SHIPPED: dict[str, Callable[..., Observation]] = {
    "state": StateVector,
    "rgb": Pixels,
    "textures": TexturedPixels,
    "textures_stack4": textures_stack4,
    "state_normalised": state_normalised,
    "rgb_stack2": rgb_stack2,
    "rgb_stack4": rgb_stack4,
}
OBSERVATIONS.update(SHIPPED)
