"""Whether things can pass each other unseen: contacts and tiles are looked for at the end of each sub-step."""

import math
from itertools import combinations

import numpy as np

from segar import language
from segar.errors import LevelError
from segar.levels.level_data import LevelData
from segar.levels.validity import per_type


def check_crossings(levels: LevelData, world: language.WorldRules, sub_steps: int, unit: str = "level") -> None:
    """Raise :class:`LevelError` where things can pass each other in a sub-step without that a contact or rule sees them.

    What comes to meet its middle at ``MaxVelocity`` must not move farther in a sub-step than the outlines reach together: the
    discs of two bodies, the discs of a thing and a tile, or the narrowest width of a hull, over which a thing's centre goes.
    What is not mobile, and by no rule becomes so, stays. A world whose limit does not take ``MaxVelocity`` bounds no speed, and
    is not checked; nor are distances that a rule or task computes by itself.

    Args:
        sub_steps: of a step, to say how many are needed.
        unit: what each of the levels is, for the message.
    """
    layout, changes = levels.layout, {factor for rule in world.rules for factor in rule.changes}
    bounded = world.limit is not None and language.MaxVelocity in world.limit.parameters
    if not bounded or language.Position not in changes or not {language.Position, language.Size} <= {*layout.columns}:
        return
    speed, rate = (levels.parameters[:, layout.parameters.index(p)] for p in (language.MaxVelocity, language.Framerate))
    extent, width = _extents(levels)
    placed, moving = per_type(levels, language.Position), per_type(levels, language.Velocity)
    solid = per_type(levels, language.Collides) & moving & (world.pair_contact is not None)
    if language.Mobile in layout.columns and all(
        effect.components[0] is language.make("const", 0.0)
        for rule in world.rules
        for effect in language.effects_of(rule.tree)
        if effect.factor is language.Mobile
    ):
        moving &= levels.values[:, :, layout.columns[language.Mobile]] != 0.0
    tile = per_type(levels, language.Floor)
    for i, j in combinations(range(len(layout.slots)), 2):
        on_tile = placed[:, i] & placed[:, j] & (tile[:, i] != tile[:, j])
        meeting = solid[:, i] & solid[:, j] & placed[:, i] & placed[:, j]
        if not (on_tile | meeting).any():
            continue
        reach = np.where(meeting, extent[:, i] + extent[:, j], np.inf)
        over = np.minimum(extent[:, i] + extent[:, j], np.minimum(width[:, i], width[:, j]))
        reach = np.where(on_tile, np.minimum(reach, over), reach)
        way = speed / rate * (moving[:, i].astype(float) + moving[:, j])
        for level in np.flatnonzero(way > reach * (1 + 1e-9))[:1]:
            needed = math.ceil(sub_steps * way[level] / reach[level])
            raise LevelError(
                f"{unit} {level}: '{layout.names[i]}' and '{layout.names[j]}' can pass each other unseen: at MaxVelocity"
                f" {speed[level]:g} m/s they come {way[level]:g} m nearer in a sub-step of {1 / rate[level]:g} s, and may come"
                f" {reach[level]:g} m. Let the levels have a MaxVelocity of at most"
                f" {math.floor(1000 * speed[level] * reach[level] / way[level]) / 1000:g}, or a Framerate of"
                f" {rate[level] * needed / sub_steps:.9g} with a task of sub_steps={needed}, which keeps the time of a step"
            )


def hull_radii(levels: LevelData) -> np.ndarray:
    """Radius of the disc around each hull, which contacts take, 0 of others, float64 ``(n, entities)`` [m]."""
    return np.sqrt((levels.vertices**2).sum(-1)).max(-1, initial=0.0)


def _extents(levels: LevelData) -> tuple[np.ndarray, np.ndarray]:
    """The diameter of each thing's disc in contacts, and the narrowest width of each hull, inf of others [m]."""
    is_hull, count = levels.shape_kind == language.HULL, levels.vertex_count
    size = levels.values[:, :, levels.layout.columns[language.Size]]
    extent = np.where(is_hull, 2 * hull_radii(levels), size)
    width = np.full(extent.shape, np.inf)
    width[is_hull] = _widths(levels.vertices[is_hull], count[is_hull])
    return extent, width


def _widths(hulls: np.ndarray, counts: np.ndarray) -> np.ndarray:
    """The narrowest width of hulls ``[hull, room, 2]``: from some edge to the vertex that is farthest from it."""
    places, room = np.arange(len(hulls)), hulls.shape[1]
    corners = np.where((np.arange(room) < counts[:, None])[..., None], hulls, hulls[:, :1])
    found = np.full(len(hulls), np.inf)
    for k in range(room):
        away = corners - corners[:, k : k + 1]
        x, y = away[places, np.where(k + 1 < counts, k + 1, 0)].T
        length = np.hypot(x, y)
        across = (x[:, None] * away[..., 1] - y[:, None] * away[..., 0]).max(axis=1)
        found = np.minimum(found, np.divide(across, length, out=np.full(len(hulls), np.inf), where=length > 0))
    return found
