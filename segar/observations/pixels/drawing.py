"""Drawing at work: one background per environment, and on it, frame by frame, what moves."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from segar.errors import SegarError
from segar.observations.pixels import pixel_kernel
from segar.observations.pixels.canvas import Canvas, pixels_as_bytes

if TYPE_CHECKING:
    from segar.levels import Levels

RENDERER_VERSION = 2
"""Raised whenever the frame of some state changes; ``tests/segar/observations/test_golden_frames.py`` holds frames of it."""


class Drawing:
    """Frames of ``num_envs`` environments, of things with given patterns.

    Attributes:
        texels: uint8 ``[env, entity, plane, P, n * texel]``: rows of each thing's pattern, which has period P; from
            any of the first P pixels on, a row goes on for whole periods.
        floor: int64 ``[env]``, which of the floors lies in each environment.

    Args:
        floors: uint8 ``[floor, P, P, 3]``, patterns of the arena's floor.
    """

    def __init__(self, canvas: Canvas, levels: Levels, num_envs: int, floors: np.ndarray) -> None:
        period = floors.shape[1]
        length = period - 1 + period * -(-pixel_kernel.RUN // period)
        entities = levels.types.shape[1]
        self.texels = np.zeros((num_envs, entities, canvas.planes, period, length * canvas.texel), np.uint8)
        self.floor = np.zeros(num_envs, np.int64)
        at = np.arange(canvas.resolution) % period
        pictures = pixels_as_bytes(floors[:, at[:, None], at], canvas)
        self._floors = pictures.reshape(len(floors), -1)
        self._backgrounds = np.zeros((num_envs, self._floors.shape[1]), np.uint8)
        self._canvas, self._geometry = canvas, pixel_kernel.frame_geometry(levels, canvas.resolution)
        self._entities = entities

    def paint(self, values: np.ndarray, level: np.ndarray, rows: np.ndarray) -> None:
        """Paint floors and tiles of environments ``rows`` (int64)."""
        pixel_kernel.paint_backgrounds(
            values, level, rows, self._geometry, self._canvas, self.texels, self.floor, self._floors, self._backgrounds,
            np.empty(self._entities, np.int64),
        )  # fmt: skip

    def draw(self, values: np.ndarray, level: np.ndarray, out: np.ndarray, rows: np.ndarray) -> None:
        """Draw the frames of environments ``rows`` (int64) into ``out``, uint8 ``[env, ...]``, each contiguous."""
        stride = out.strides[0]
        if out.flags.c_contiguous:
            frames = out.reshape(-1)
        elif out[0].flags.c_contiguous and stride > 0:
            frames = np.lib.stride_tricks.as_strided(out, ((len(out) - 1) * stride + out[0].size,), (1,))
        else:
            raise SegarError(f"frames are drawn into contiguous memory only, not into strides of {out.strides} bytes")
        pixel_kernel.draw_frames(
            values, level, rows, self._geometry, self._canvas, self.texels, self._backgrounds, frames, stride,
            np.empty(self._entities, np.int64),
        )  # fmt: skip
