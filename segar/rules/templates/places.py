"""Templates of places: portals, one-way walls, switches, and goals that move or hide."""

# Hints of rules name factors and constants that are arguments of the template, which pyright takes for variables.
# pyright: reportInvalidTypeForm=false

from typing import Any, Tuple  # noqa: UP035 - the paper writes rules with typing.Tuple

import numpy as np

from segar.errors import RuleError
from segar.language import (
    Differential,
    Factor,
    Framerate,
    GoalTile,
    Mass,
    Position,
    SetFactor,
    Tile,
    VectorValue,
    Velocity,
    Visible,
    is_on,
    rule,
)
from segar.noise import Choice, as_noise
from segar.rules.rule_option import RuleOption
from segar.rules.templates.arguments import made_constant, require_numbers, require_tiles, require_values

PLACE = Choice([-0.6, -0.2, 0.2, 0.6])  # [m], a coordinate in the arena
EITHER_WAY = Choice([-1.0, 1.0])
DRIFT = Choice([-0.2, -0.1, 0.1, 0.2])  # [m/s]
HALF_WIDTH = 0.06  # [m] of a one-way wall; the fastest body of the default rules moves 0.1 in a sub-step


def portal(
    name: str, x: Any = PLACE, y: Any = PLACE, to_x: Any = PLACE, to_y: Any = PLACE, radius: Any = 0.1
) -> RuleOption:
    """A disc that sends bodies whose centre enters it to another place, with the velocity that they have.

    Args:
        x, y: centre of the disc [m].
        to_x, to_y: the place that they are sent to [m].
        radius: of the disc [m].
    """
    inside = (-1.0, 1.0)
    cx, cy = made_constant(name, "x", 0.0, "m", inside), made_constant(name, "y", 0.0, "m", inside)
    tx, ty = made_constant(name, "to_x", 0.0, "m", inside), made_constant(name, "to_y", 0.0, "m", inside)
    r = made_constant(name, "radius", 0.1, "m", (0.0, 1.0))

    def portal(
        place: Position, v: Velocity, m: Mass, x: cx, y: cy, to_x: tx, to_y: ty, radius: r
    ) -> SetFactor[Position]:
        away = VectorValue(place.x - x, place.y - y)
        if away.dot(away) >= radius * radius:
            return None
        return SetFactor[Position](place, VectorValue(to_x, to_y))

    words = (
        f"a portal of radius {{{r.__name__}}} m at ({{{cx.__name__}}}, {{{cy.__name__}}}) m leads to"
        f" ({{{tx.__name__}}}, {{{ty.__name__}}}) m"
    )
    return RuleOption(name, portal, {cx: x, cy: y, tx: to_x, ty: to_y, r: radius}, words=words)


def one_way_wall(name: str, axis: int = 0, at: Any = PLACE, forward: Any = EITHER_WAY) -> RuleOption:
    """A wall across the arena that bodies pass in one direction; from the other side they are reflected.

    Args:
        axis: 0 for a wall at a fixed x, 1 for one at a fixed y.
        at: its place on that axis [m].
        forward: 1 where bodies pass towards greater numbers, -1 towards smaller ones.
    """
    if axis not in (0, 1):
        raise RuleError(f"one_way_wall '{name}': the axis must be 0 or 1, not {axis!r}")
    ways, masses = as_noise(forward).atoms
    if abs(masses.sum() - 1) > 1e-9 or not np.isin(ways, (-1.0, 1.0)).all():
        raise RuleError(f"one_way_wall '{name}': forward must be 1 or -1, or a Choice of both, not {forward!r}")
    place, way = made_constant(name, "at", 0.0, "m", (-1.0, 1.0)), made_constant(name, "forward", 1.0, "", (-1.0, 1.0))

    def one_way_wall(
        x: Position, v: Velocity, m: Mass, at: place, forward: way, framerate: Framerate
    ) -> Differential[Velocity]:
        distance = (x.x, x.y)[axis] - at
        speed = (v.x, v.y)[axis]
        if abs(distance) > HALF_WIDTH or speed * forward >= 0:
            return None
        change = -2.0 * speed * framerate
        return Differential[Velocity](v, (change, 0.0 * change) if axis == 0 else (0.0 * change, change))

    words = (
        f"a wall at {'xy'[axis]} = {{{place.__name__}}} m is passed in the direction {{{way.__name__}}} only; within"
        f" {HALF_WIDTH:g} m of it, velocities against that are reflected"
    )
    return RuleOption(name, one_way_wall, {place: at, way: forward}, words=words)


def switch(name: str, tile: type[Tile], factor: type[Factor], value: Any) -> RuleOption:
    """A tile that sets a factor of the bodies that are on it.

    Args:
        tile: the type of the tiles.
        factor: of bodies, one number.
        value: that it gets.
    """
    require_tiles(name, tile)
    require_numbers(name, factor)
    require_values(name, "value", value, factor)
    to = made_constant(name, "value", 0.0)

    @rule(relation=is_on)
    def switch(body: Tuple[factor, Velocity], ground: tile, value: to) -> SetFactor[factor]:
        old, _ = body
        return SetFactor[factor](old, value)

    words = f"a {tile.__name__} sets {factor.__name__} of bodies on it to {{{to.__name__}}}"
    return RuleOption(name, switch, {to: value}, words=words)


def drifting(name: str, tile: type[Tile] = GoalTile, speed: Any = DRIFT) -> RuleOption:
    """Tiles that drift around the middle of the arena and never leave it: along the lines on which
    ``(1 - x^2)(1 - y^2)`` is constant.

    Args:
        speed: [m/s] half-way between the middle and a wall it is about 0.75 times this; positive is clockwise.
    """
    require_tiles(name, tile)
    s = made_constant(name, "speed", 0.0, "m/s")

    def drifting(thing: tile, speed: s) -> Differential[Position]:
        place = thing[Position]
        x, y = place.x, place.y
        return Differential[Position](
            place, VectorValue(2.0 * speed * y * (1.0 - x * x), -2.0 * speed * x * (1.0 - y * y))
        )

    words = f"a {tile.__name__} at (x, y) drifts by 2 x {{{s.__name__}}} m/s x (y (1 - x^2), -x (1 - y^2))"
    return RuleOption(name, drifting, {s: speed}, words=words)


def hiding(name: str, tile: type[Tile] = GoalTile) -> RuleOption:
    """Tiles that cannot be seen; they act as before."""
    require_tiles(name, tile)

    def hiding(thing: tile) -> SetFactor[Visible]:
        return SetFactor[Visible](thing[Visible], 0.0)

    return RuleOption(name, hiding, words=f"a {tile.__name__} cannot be seen")
