"""What an agent sees: states, pixels, and observations that are composed of others.

The room imports the levels, the engine and the textures. Other rooms use the names below.
"""

from segar.observations.composed.actions import PreviousActions
from segar.observations.composed.joined import Joined
from segar.observations.composed.multi import Multi, OneOf, make_observation, trained_on
from segar.observations.composed.previous_step import PreviousStep
from segar.observations.composed.stack import Stack
from segar.observations.copying import copy_rows, copy_squares
from segar.observations.pixels.solid_colours import COLOURS, RGB, Colour, Pixels, colour_of
from segar.observations.pixels.textured import TexturedPixels
from segar.observations.protocol import (
    Arrays,
    BoundObservation,
    Observation,
    ObservationLike,
    RunsOnTargets,
    calls_of,
    draws_per_episode,
    empty_batch,
    for_task,
    hooks_of,
    leaves,
    map_leaves,
    own_arrays,
    simulator_reads,
    without_calls,
)
from segar.observations.registry import OBSERVATIONS
from segar.observations.shipped import SHIPPED
from segar.observations.state.state_vector import AllObjects, AllState, AllTiles, ObjectState, StateVector, TileState

__all__ = [
    "COLOURS", "OBSERVATIONS", "RGB", "SHIPPED", "AllObjects", "AllState", "AllTiles", "Arrays", "BoundObservation",
    "Colour", "Joined", "Multi", "ObjectState", "Observation", "ObservationLike", "OneOf", "Pixels", "PreviousActions",
    "PreviousStep", "RunsOnTargets", "Stack", "StateVector", "TexturedPixels", "TileState", "calls_of", "colour_of",
    "copy_rows", "copy_squares", "draws_per_episode", "empty_batch", "for_task", "hooks_of", "leaves", "make_observation",
    "map_leaves", "own_arrays", "simulator_reads", "trained_on", "without_calls",
]  # fmt: skip
