"""The observations that have a name: those that come with SEGAR."""

from collections.abc import Callable
from functools import partial
from typing import Any

from segar.observations.composed.multi import OBSERVATIONS, Joined
from segar.observations.composed.past import PreviousStep
from segar.observations.composed.stack import Stack
from segar.observations.pixels.solid_colours import Pixels
from segar.observations.pixels.textured import TexturedPixels
from segar.observations.protocol import Observation
from segar.observations.state.state_vector import StateVector


def _stacked(frames: type[Pixels | TexturedPixels], n: int, **options: Any) -> Stack:
    """The last ``n`` frames, which show positions and velocities; options are those of the frames."""
    return Stack(frames(**options), n)


def _with_past(reward_scale: float = 1.0, **options: Any) -> Joined:
    """The state, and whether an episode has just begun, the last action and its reward; options are those of the state."""
    return Joined([StateVector(**options), PreviousStep(reward_scale=reward_scale)])


SHIPPED: dict[str, Callable[..., Observation]] = {
    "state": StateVector,
    "rgb": Pixels,
    "textures": TexturedPixels,
    "textures_stack2": partial(_stacked, TexturedPixels, n=2),
    "textures_stack4": partial(_stacked, TexturedPixels, n=4),
    "state_normalised": partial(StateVector, normalise=True),  # in units of the prior
    "state_past": _with_past,  # and the last step, also over the trials of a level
    "rgb_stack2": partial(_stacked, Pixels, n=2),
    "rgb_stack4": partial(_stacked, Pixels, n=4),
}
OBSERVATIONS.update(SHIPPED)
