"""The form of a frame: how many pixels, which part of the world, and where the bytes of a pixel lie."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Literal, NamedTuple

import gymnasium
import numpy as np

from segar.errors import SegarError, did_you_mean
from segar.language import ARENA

if TYPE_CHECKING:
    from segar.levels import Levels

Channels = Literal["first", "last"]
CHANNELS = ("first", "last")
LUMA = (299, 587, 114)  # thousandths of red, green and blue in grey (ITU-R BT.601)


class Canvas(NamedTuple):
    """What a kernel knows of a frame: ``uint8[planes, resolution, resolution, texel]``, rows from the top.

    A pixel of an RGB frame is three bytes side by side (one plane, texel 3), or one byte in each of three planes; that
    of a grey frame is one byte.
    """

    resolution: int
    walls: float
    """Distance of the frame's edges from the middle of the world [m]."""
    scale: float
    """Pixels per metre."""
    planes: int
    texel: int
    """Bytes of a pixel within a plane."""


def canvas_for(resolution: int, grey: bool, channels: Channels, levels: Levels) -> Canvas:
    """The canvas that shows the arena of these levels, from wall to wall."""
    walls = levels.world.walls if levels.world is not None else ARENA
    first = not grey and channels == "first"
    return Canvas(resolution, walls, resolution / (2 * walls), 3 if first else 1, 1 if grey or first else 3)


def frame_space(resolution: int, grey: bool, channels: Channels) -> gymnasium.spaces.Box:
    """The space of single frames, uint8: ``[resolution, resolution, 3]``, the 3 first or last, 1 where they are grey."""
    depth, side = (1 if grey else 3), (resolution, resolution)
    return gymnasium.spaces.Box(0, 255, (depth, *side) if channels == "first" else (*side, depth), np.uint8)


def check_frame(who: str, resolution: int, channels: str) -> None:
    """Refuse frames that are not whole 64-bit words, and unknown orders of channels; raises :class:`SegarError`."""
    if resolution % 4 or not 32 <= resolution <= 256:
        raise SegarError(f"{who}: resolution must be a multiple of 4 from 32 to 256, not {resolution!r}")
    if channels not in CHANNELS:
        raise SegarError(
            f"{who}: channels must be 'first' or 'last', not {channels!r}.{did_you_mean(str(channels), CHANNELS)}"
        )


def pixels_as_bytes(rgb: np.ndarray, canvas: Canvas) -> np.ndarray:
    """Pictures, uint8 ``[..., rows, columns, 3]``, as the bytes of frames, uint8 ``[..., planes, rows, columns * texel]``."""
    if canvas.planes == 3:
        return np.ascontiguousarray(np.moveaxis(rgb, -1, -3))
    if canvas.texel == 1:
        return grey_of(rgb)[..., None, :, :]
    return np.ascontiguousarray(rgb).reshape(*rgb.shape[:-3], 1, rgb.shape[-3], -1)


def grey_of(rgb: Any) -> np.ndarray:
    """Grey of colours, uint8 ``[...]`` of uint8 ``[..., 3]``: their luma, rounded."""
    return ((np.asarray(rgb, np.int64) @ np.array(LUMA) + 500) // 1000).astype(np.uint8)
