"""Which colour a thing has: one per entity type, shaded by the factor that makes the type what it is."""

from collections.abc import Mapping
from dataclasses import dataclass

from segar.errors import FactorError
from segar.language import (
    Ball,
    Bumper,
    Charge,
    Charger,
    CueBall,
    Damper,
    Entity,
    Factor,
    FireTile,
    Friction,
    GoalTile,
    GolfBall,
    Heat,
    Hole,
    MagmaTile,
    Magnet,
    Magnetism,
    SandTile,
    StoredEnergy,
    Tile,
)

RGB = tuple[int, int, int]

FLOOR: RGB = (72, 72, 72)  # dark enough for the white ball, light enough for black outlines and holes
OUTLINE: RGB = (0, 0, 0)


@dataclass(frozen=True)
class Colour:
    """A colour, or a blend of two by a factor's value.

    The colour is ``low`` where the factor is at or below ``span[0]``, ``high`` at or above ``span[1]``, and the linear
    blend, rounded to whole numbers, between. Without ``high`` it is ``low`` throughout.
    """

    low: RGB
    high: RGB | None = None
    factor: type[Factor] | None = None
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
COLOURS: Mapping[type[Entity], Colour] = {
    Entity: Colour((165, 165, 185)),  # types without a nearer ancestor in this table
    GolfBall: Colour((255, 255, 255)),
    CueBall: Colour((255, 255, 255)),
    Ball: Colour((255, 215, 0)),
    Charger: Colour((160, 0, 220), (0, 225, 235), Charge, (-1.0, 1.0)),
    Magnet: Colour((255, 70, 170), (0, 170, 60), Magnetism, (-1.0, 1.0)),
    Bumper: Colour((120, 160, 20), (190, 255, 30), StoredEnergy, (0.0, 1.0)),
    Damper: Colour((95, 40, 0), (150, 85, 25), StoredEnergy, (-1.0, 0.0)),
    Tile: Colour((0, 95, 95)),
    GoalTile: Colour((0, 0, 255)),
    Hole: Colour((0, 0, 0)),
    SandTile: Colour((240, 225, 175), (205, 170, 90), Friction, (0.0, 1.0)),
    MagmaTile: Colour((190, 30, 30), (230, 0, 0), Heat, (0.0, 1.0)),
    FireTile: Colour((255, 165, 60), (255, 110, 0), Heat, (0.0, 1.0)),
}


def colour_of(entity: type[Entity], colours: Mapping[type[Entity], Colour] = COLOURS) -> Colour:
    """The colour of an entity type: its own, or that of its nearest ancestor in ``colours``."""
    return next(colours[c] for c in entity.__mro__ if c in colours)
