"""Pixels: the arena from above, solid colours, drawn by a compiled kernel straight into the batch buffer."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

import numpy as np

from segar.language import Entity, Factor, Floor, Shape
from segar.observations.pixels import tint_kernel
from segar.observations.pixels.canvas import LUMA, Channels, canvas_for, check_frame, frame_space
from segar.observations.pixels.colours import COLOURS, FLOOR, Colour, colour_of
from segar.observations.pixels.drawing import Drawing
from segar.observations.pixels.pixel_kernel import DRAWN, column_of

if TYPE_CHECKING:
    from segar.levels import Levels

OUTLINES: tuple[type[Factor], ...] = (*DRAWN, Shape, Floor)
"""Factors that decide where things are drawn, how large, and over which others."""


@dataclass(frozen=True)
class Pixels:
    """Frames, uint8 ``[resolution, resolution, 3]``, of the arena from above with y pointing up, in solid colours.

    Tiles form the background: they are painted when an episode starts, and neither their place nor their look changes
    within it. Objects are drawn in every frame where they are, as large as they are, if they are visible; their colour
    follows their factors (:mod:`segar.observations.pixels.colours`). Among tiles the lowest Order lies on top, among objects
    the highest, and objects lie on tiles. Tiles and mobile objects have a black outline.

    Args:
        resolution: side of the frame in pixels, a multiple of 4 from 32 to 256.
        colours: entity type to its colour, beside the built-in ones; a type without one takes its nearest ancestor's.
        grey: whether frames show the luma of the colours alone, one number per pixel.
        channels: whether the axis of the colours is the "last" or the "first" of a frame.

    Raises:
        SegarError: the resolution or the channels are not one of these.
    """

    resolution: int = 64
    colours: Mapping[type[Entity], Colour] = field(default_factory=dict)
    grey: bool = False
    channels: Channels = "last"

    def __post_init__(self) -> None:
        check_frame("Pixels", self.resolution, self.channels)

    def shows(self, factor: type[Factor]) -> bool:
        """Whether frames may depend on the factor: on what decides outlines, or on what blends a colour."""
        blending = {c.factor for c in {**COLOURS, **self.colours}.values() if c.factor is not None}
        return issubclass(factor, (*OUTLINES, *blending))

    def in_planes(self) -> Pixels:
        """The same frames with their channels first."""
        return replace(self, channels="first")

    def bind(self, levels: Levels, num_envs: int) -> BoundPixels:
        """The observation at work: holds one background per environment, as large as a frame."""
        return BoundPixels(self, levels, num_envs)


class BoundPixels:
    """:class:`Pixels` in one environment; see :class:`segar.observations.protocol.BoundObservation`."""

    def __init__(self, pixels: Pixels, levels: Levels, num_envs: int) -> None:
        self.space = frame_space(pixels.resolution, pixels.grey, pixels.channels)
        canvas = canvas_for(pixels.resolution, pixels.grey, pixels.channels, levels)
        self._drawing = Drawing(canvas, levels, num_envs, np.array(FLOOR, np.uint8)[None, None, None])
        types = levels.layout.types
        colours = [colour_of(t, {**COLOURS, **pixels.colours}) for t in types]
        columns = [
            column_of(levels.layout, t, c.factor) if c.factor is not None else -1
            for t, c in zip(types, colours, strict=True)
        ]
        tints = [(c.low, c.high or c.low, (*c.span, 0.0)) for c in colours]
        is_floor = np.array([Floor in t.declared for t in types])
        self._may_change = bool(
            (~is_floor & (np.array(columns) >= 0)).any()
        )  # whether colours follow factors of objects
        self._blends = np.full((num_envs, levels.types.shape[1]), np.nan)
        self._tints = (
            levels.types,
            is_floor,
            np.array(columns, np.int64),
            np.array(tints, np.float64),
            np.array(LUMA if pixels.grey else (0, 0, 0), np.int64),
            self._blends,
            self._drawing.texels,
        )

    def begin(self, values: np.ndarray, level: np.ndarray, mask: np.ndarray) -> None:
        """Paint the backgrounds of the environments where ``mask`` is true from their states and levels."""
        rows = np.flatnonzero(mask)
        self._blends[rows] = np.nan
        tint_kernel.tint_things(values, level, rows, True, *self._tints)
        self._drawing.paint(values, level, rows)

    def write(self, values: np.ndarray, level: np.ndarray, out: np.ndarray, rows: np.ndarray) -> None:
        """Draw the frames of environments ``rows`` (int64) into ``out``, uint8 ``[env, *space.shape]``."""
        if self._may_change:
            tint_kernel.tint_things(values, level, rows, False, *self._tints)
        self._drawing.draw(values, level, out, rows)
