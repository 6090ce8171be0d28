"""Pixels: the arena from above, solid colours, drawn by a compiled kernel straight into the batch buffer."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import gymnasium
import numpy as np

from segar.engine.layout import Layout, holds
from segar.entities import Entity
from segar.errors import SegarError
from segar.factors import Factor, Floor, Mobile, Order, Position, Size, Visible
from segar.observations import pixel_kernel
from segar.observations.colours import COLOURS, FLOOR, Colour, colour_of

if TYPE_CHECKING:
    from segar.levels import Levels


@dataclass(frozen=True)
class Pixels:
    """RGB frames, uint8 ``[resolution, resolution, 3]``, seen from above with y pointing up.

    Tiles form the background: they are painted when an episode starts, and neither their place nor their look changes
    within it. Objects are drawn in every frame where they are, as large as they are, if they are visible; their colour
    follows their factors (:mod:`segar.observations.colours`). Among tiles the lowest Order lies on top, among objects
    the highest, and objects lie on tiles. Tiles and mobile objects have a black outline.

    Args:
        resolution: side of the frame in pixels, a multiple of 4 from 32 to 256.
        colours: entity type to its colour, beside the built-in ones; a type without one takes its nearest ancestor's.

    Raises:
        SegarError: the resolution is not one of these.
    """

    resolution: int = 64
    colours: Mapping[type[Entity], Colour] = field(default_factory=dict)

    def __post_init__(self) -> None:
        if self.resolution % 4 or not 32 <= self.resolution <= 256:  # a frame must be whole 64-bit words
            raise SegarError(f"Pixels: resolution must be a multiple of 4 from 32 to 256, not {self.resolution!r}")

    def bind(self, levels: Levels, num_envs: int) -> BoundPixels:
        """The observation at work: holds one background per environment (``3 * resolution**2`` bytes each)."""
        return BoundPixels(self, levels, num_envs)


class BoundPixels:
    """:class:`Pixels` in one environment; see :class:`segar.observations.protocol.BoundObservation`."""

    def __init__(self, pixels: Pixels, levels: Levels, num_envs: int) -> None:
        side = pixels.resolution
        self.space = gymnasium.spaces.Box(0, 255, (side, side, 3), np.uint8)
        types = levels.layout.types
        self._scene = (
            levels.types,
            levels.shape_kind,
            levels.vertex_count,
            levels.vertices,
            pixel_kernel.edge_lines(levels.vertices, levels.vertex_count),
            _columns(levels.layout, pixels),
            np.array([Floor in t.declared for t in types]),
            _tints(levels.layout, pixels),
            pixel_kernel.disc_spans(side),
        )
        self._floor = np.tile(np.array(FLOOR, np.uint8), side * side).view(np.uint64)
        self._backgrounds = np.zeros((num_envs, 3 * side * side), np.uint8)

    def begin(self, values: np.ndarray, level: np.ndarray, mask: np.ndarray) -> None:
        """Paint the backgrounds of the environments where ``mask`` is true from their states and levels."""
        pixel_kernel.paint_backgrounds(
            values,
            level,
            mask,
            *self._scene,
            self._floor,
            self._backgrounds.view(np.uint64),
            self._backgrounds,
            np.empty(self._scene[0].shape[1], np.int64),
        )

    def write(self, values: np.ndarray, level: np.ndarray, out: np.ndarray, rows: np.ndarray) -> None:
        """Draw the frames of environments ``rows`` (int64) into ``out``, uint8 ``[env, *space.shape]``, contiguous."""
        frames = out.reshape(len(out), -1)
        pixel_kernel.draw_frames(
            values,
            level,
            rows,
            *self._scene,
            self._backgrounds.view(np.uint64),
            frames.view(np.uint64),
            frames,
            np.empty(self._scene[0].shape[1], np.int64),
        )


def _columns(layout: Layout, pixels: Pixels) -> np.ndarray:
    """Columns that the kernel reads, int64 ``[type, 6]`` in the order of ``pixel_kernel.POSITION`` and so on."""
    colours = {**COLOURS, **pixels.colours}

    def column(entity: type[Entity], factor: type[Factor] | None) -> int:
        held = holds(entity, factor) if factor is not None else None
        return layout.columns[held] if held is not None else -1

    read: tuple[type[Factor], ...] = (Position, Size, Visible, Order, Mobile)
    return np.array(
        [[*(column(t, f) for f in read), column(t, colour_of(t, colours).factor)] for t in layout.types], np.int64
    )


def _tints(layout: Layout, pixels: Pixels) -> np.ndarray:
    """Low colour, high colour and span of each type, float64 ``[type, 3, 3]``."""
    colours = {**COLOURS, **pixels.colours}
    tints = np.zeros((len(layout.types), 3, 3))
    for row, entity in zip(tints, layout.types, strict=True):
        colour = colour_of(entity, colours)
        row[0], row[1], row[2, :2] = colour.low, colour.high or colour.low, colour.span
    return tints
