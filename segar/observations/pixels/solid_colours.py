"""Pixels: the arena from above in solid colours, drawn by a compiled kernel straight into the batch buffer. There is one colour
per entity type, shaded by the factor that makes the type what it is."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np

from segar import language
from segar.engine import Call, Rows, call_of
from segar.errors import FactorError
from segar.levels import Levels
from segar.observations.copying import KERNEL_OPTIONS
from segar.observations.pixels import drawing
from segar.observations.pixels.drawing import LUMA, SIZES, Channels, Drawing, column_of
from segar.support import cached

RGB = tuple[int, int, int]

FLOOR: RGB = (72, 72, 72)  # dark enough for the white ball, light enough for black outlines and holes


@dataclass(frozen=True)
class Colour:
    """A colour, or a blend of two by a factor's value.

    The colour is ``low`` where the factor is at or below ``span[0]``, ``high`` at or above ``span[1]``, and the linear
    blend, rounded to whole numbers, between. Without ``high`` it is ``low`` throughout.
    """

    low: RGB
    high: RGB | None = None
    factor: type[language.Factor] | None = None
    span: tuple[float, float] = (0.0, 1.0)

    def __post_init__(self) -> None:
        for rgb in (self.low, self.high or self.low):
            if len(rgb) != 3 or not all(isinstance(c, int) and 0 <= c <= 255 for c in rgb):
                raise FactorError(f"a colour is three whole numbers from 0 to 255, not {rgb!r}")
        if (self.high is None) != (self.factor is None):
            raise FactorError("a blended colour needs both the second colour `high` and the `factor` that blends")
        if self.factor is not None and self.factor.width != 1:
            raise FactorError(f"a colour follows one number; {self.factor.__name__} has {self.factor.width} columns")
        if not self.span[0] < self.span[1]:
            raise FactorError(f"a colour's span goes from a smaller to a larger value, not {self.span!r}")


# Hues far apart: things that can meet in one level differ in hue, and a factor's sign changes the hue again.
COLOURS: Mapping[type[language.Entity], Colour] = {
    language.Entity: Colour((165, 165, 185)),  # types without a nearer ancestor in this table
    language.GolfBall: Colour((255, 255, 255)),
    language.CueBall: Colour((255, 255, 255)),
    language.Ball: Colour((255, 215, 0)),
    language.Charger: Colour((160, 0, 220), (0, 225, 235), language.Charge, (-1.0, 1.0)),
    language.Magnet: Colour((255, 70, 170), (0, 170, 60), language.Magnetism, (-1.0, 1.0)),
    language.Bumper: Colour((120, 160, 20), (190, 255, 30), language.StoredEnergy, (0.0, 1.0)),
    language.Damper: Colour((95, 40, 0), (150, 85, 25), language.StoredEnergy, (-1.0, 0.0)),
    language.Tile: Colour((0, 95, 95)),
    language.GoalTile: Colour((0, 0, 255)),
    language.Hole: Colour((0, 0, 0)),
    language.SandTile: Colour((240, 225, 175), (205, 170, 90), language.Friction, (0.0, 1.0)),
    language.MagmaTile: Colour((190, 30, 30), (230, 0, 0), language.Heat, (0.0, 1.0)),
    language.FireTile: Colour((255, 165, 60), (255, 110, 0), language.Heat, (0.0, 1.0)),
}


def colour_of(entity: type[language.Entity], colours: Mapping[type[language.Entity], Colour] = COLOURS) -> Colour:
    """The colour of an entity type: its own, or that of its nearest ancestor in ``colours``."""
    return next(colours[c] for c in entity.__mro__ if c in colours)


OUTLINES: tuple[type[language.Factor], ...] = (*drawing.DRAWN, language.Shape, language.Floor)
"""Factors that decide where things are drawn, how large, and over which others."""


@dataclass(frozen=True)
class Pixels:
    """Frames, uint8 ``[resolution, resolution, 3]``, of the arena from above with y pointing up, in solid colours.

    Tiles form the background: they are painted when an episode starts, and neither their place nor their look changes
    within it. Objects are drawn in every frame where they are, as large as they are, if they are visible; their colour
    follows their factors (:data:`COLOURS`). Among tiles the lowest Order lies on top, among objects
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
    colours: Mapping[type[language.Entity], Colour] = field(default_factory=dict)
    grey: bool = False
    channels: Channels = "last"

    def __post_init__(self) -> None:
        drawing.check_frame("Pixels", self.resolution, self.channels)

    def shows(self, factor: type[language.Factor]) -> bool:
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
        self.space = drawing.frame_space(pixels.resolution, pixels.grey, pixels.channels)
        canvas = drawing.canvas_for(pixels.resolution, pixels.grey, pixels.channels, levels)
        self._drawing = Drawing(canvas, levels, num_envs, np.array(FLOOR, np.uint8)[None, None, None])
        types = levels.layout.types
        colours = [colour_of(t, {**COLOURS, **pixels.colours}) for t in types]
        columns = [
            column_of(levels.layout, t, c.factor) if c.factor is not None else -1
            for t, c in zip(types, colours, strict=True)
        ]
        tints = [(c.low, c.high or c.low, (*c.span, 0.0)) for c in colours]
        is_floor = np.array([language.Floor in t.declared for t in types])
        self._may_change = bool((~is_floor & (np.array(columns) >= 0)).any())  # whether objects' colours follow factors
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
        tint_things(values, level, rows, True, *self._tints)
        self._drawing.paint(values, level, rows)

    def write(self, values: np.ndarray, level: np.ndarray, out: np.ndarray, rows: np.ndarray) -> None:
        """Draw the frames of environments ``rows`` (int64) into ``out``, uint8 ``[env, *space.shape]``."""
        if self._may_change:
            tint_things(values, level, rows, False, *self._tints)
        self._drawing.draw(values, level, out, rows)

    def calls(self, when: str, in_rows: bool = False) -> list[Call]:
        """What ``begin`` and ``write`` do, for other targets; see :class:`segar.observations.protocol.RunsOnTargets`."""
        values, level = self._drawing.states
        found = []
        if when == "begin" or (when == "write" and self._may_change):
            arguments = [values, level, Rows(), when == "begin", *self._tints]
            found.append(call_of(f"tint_to_{when}", tint_things, arguments, SIZES))
        return found + self._drawing.calls(when, in_rows)


@cached(**KERNEL_OPTIONS)
def tint_things(values, level, rows, tiles_too, types, is_floor, columns, tints, luma, blends, texels):
    """Colour the things of environments ``rows``: all, or those whose blend is another one than ``blends[env, entity]``.

    Args:
        tiles_too: whether all things are coloured; otherwise objects whose blend has changed.
        columns: int64 ``[type]``, column of the factor that blends; -1 for none.
        tints: float64 ``[type, 3, 3]``: low colour, high colour, and the span of the factor in the third row.
        luma: int64 ``[3]``: weights of red, green and blue in grey, in thousandths; all 0 for RGB frames.
        blends: float64 ``[env, entity]``, nan for what has no colour yet.
        texels: uint8 ``[env, entity, plane, 1, n * texel]``, the patterns.
    """
    for r in range(len(rows)):
        env = rows[r]
        for entity in range(types.shape[1]):
            kind = types[level[env], entity]
            if kind < 0 or (is_floor[kind] and not tiles_too):
                continue
            blend = 0.0
            if columns[kind] >= 0:
                low, high = tints[kind, 2, 0], tints[kind, 2, 1]
                blend = min(max((values[env, entity, columns[kind]] - low) / (high - low), 0.0), 1.0)
            if tiles_too or blend != blends[env, entity]:
                blends[env, entity] = blend
                fill(env, entity, kind, blend, tints, luma, texels)


@cached(**KERNEL_OPTIONS)
def fill(env, entity, kind, blend, tints, luma, texels):
    """Make a thing's pattern of one colour."""
    colour = (blended(tints, kind, 0, blend), blended(tints, kind, 1, blend), blended(tints, kind, 2, blend))
    grey = np.uint8((luma[0] * colour[0] + luma[1] * colour[1] + luma[2] * colour[2] + 500) // 1000)
    for plane in range(texels.shape[2]):
        for k in range(texels.shape[4]):
            channel = plane if texels.shape[2] == 3 else k % 3
            texels[env, entity, plane, 0, k] = grey if luma[1] > 0 else colour[channel]


@cached(**KERNEL_OPTIONS)
def blended(tints, kind, channel, blend):
    """One channel of the colour between the low and the high colour of an entity type, uint8."""
    low, high = tints[kind, 0, channel], tints[kind, 1, channel]
    return np.uint8(np.rint(low + blend * (high - low)))
