"""What an agent sees: states, pixels, and observations that are composed of others."""

from segar.observations.arrays import build, empty_batch, leaves, map_leaves
from segar.observations.copying import copy_rows, copy_squares
from segar.observations.pixels.colours import COLOURS, RGB, Colour, colour_of
from segar.observations.pixels.solid_colours import Pixels
from segar.observations.pixels.textured import TexturedPixels
from segar.observations.registry import OBSERVATIONS, for_task, make_observation

__all__ = [
    "COLOURS",
    "OBSERVATIONS",
    "RGB",
    "Colour",
    "Pixels",
    "TexturedPixels",
    "build",
    "colour_of",
    "copy_rows",
    "copy_squares",
    "empty_batch",
    "for_task",
    "leaves",
    "make_observation",
    "map_leaves",
]
