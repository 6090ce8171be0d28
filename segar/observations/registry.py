"""Observations by their names, and from tuples and dicts."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from typing import TYPE_CHECKING, Any

from segar.errors import SegarError, did_you_mean
from segar.observations.composed.multi import Multi
from segar.observations.composed.stack import Stack
from segar.observations.pixels.solid_colours import Pixels
from segar.observations.pixels.textured import TexturedPixels
from segar.observations.state.state_vector import StateVector

if TYPE_CHECKING:
    from segar.language import Task


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


OBSERVATIONS: dict[str, Callable[..., Any]] = {
    "state": StateVector,
    "rgb": Pixels,
    "textures": TexturedPixels,
    "textures_stack4": textures_stack4,
    "state_normalised": state_normalised,
    "rgb_stack2": rgb_stack2,
    "rgb_stack4": rgb_stack4,
}


def make_observation(observation: Any) -> Any:
    """An observation from its name, from a tuple, list or dict of observations, or the observation itself.

    Raises:
        SegarError: no observation is called so, or it is none.
    """
    if isinstance(observation, str):
        if observation not in OBSERVATIONS:
            raise SegarError(f"no observation is called '{observation}'.{did_you_mean(observation, OBSERVATIONS)}")
        return OBSERVATIONS[observation]()
    if isinstance(observation, (tuple, list, Mapping)):
        return Multi(observation)
    if not hasattr(observation, "bind"):
        names = ", ".join(f"'{name}'" for name in OBSERVATIONS)
        raise SegarError(f"observation must be {names}, a tuple or dict, or an object with bind(), not {observation!r}")
    return observation


def for_task(observation: Any, task: Task) -> Any:
    """The observation in environments of a task, if it depends on it; see :class:`segar.observations.protocol.KnowsTask`."""
    return observation.for_task(task) if hasattr(observation, "for_task") else observation


def parts_of(observation: Any) -> Iterator[Any]:
    """The observation, and all that it consists of."""
    yield observation
    for member in getattr(observation, "members", ()):
        yield from parts_of(member)
