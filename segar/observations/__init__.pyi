from .composed.composed import recall_array as recall_array
from .composed.multi import (
    OBSERVATIONS as OBSERVATIONS,
    Joined,
    Multi,
    OneOf,
    make_observation as make_observation,
    trained_on as trained_on,
)
from .composed.past import PreviousActions, PreviousStep
from .composed.stack import Stack
from .copying import copy_rows as copy_rows, copy_squares as copy_squares
from .pixels.solid_colours import COLOURS as COLOURS, RGB as RGB, Colour, Pixels, colour_of as colour_of
from .pixels.textured import TexturedPixels
from .protocol import (
    Arrays as Arrays,
    BoundObservation as BoundObservation,
    Observation as Observation,
    ObservationLike as ObservationLike,
    RunsOnTargets as RunsOnTargets,
    adapted as adapted,
    calls_of as calls_of,
    draws_per_episode as draws_per_episode,
    empty_batch as empty_batch,
    hooks_of as hooks_of,
    leaves as leaves,
    map_leaves as map_leaves,
    own_arrays as own_arrays,
    simulator_reads as simulator_reads,
    without_calls as without_calls,
)
from .shipped import SHIPPED as SHIPPED
from .state.state_vector import AllObjects, AllState, AllTiles, ObjectState, StateVector, TileState

__all__ = [
    "AllObjects", "AllState", "AllTiles", "Colour", "Joined", "Multi", "ObjectState", "OneOf", "Pixels",
    "PreviousActions", "PreviousStep", "Stack", "StateVector", "TexturedPixels", "TileState",
]  # fmt: skip
