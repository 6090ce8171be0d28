"""Whether things can pass each other unseen: contacts and tiles are looked for at the end of each sub-step."""

import math
from itertools import combinations

import numpy as np

from segar import language
from segar.errors import LevelError
from segar.levels.level_data import LevelData
from segar.levels.validity import per_type

DIRECTIONS = 32  # of ways through a hull: the shortest of them is at most 0.2 % longer than the shortest of all


def check_crossings(levels: LevelData, world: language.WorldRules, sub_steps: int, unit: str = "level") -> None:
    """Raise :class:`LevelError` where things can pass each other in a sub-step without that a contact or rule sees them.

    What comes to meet its middle at ``MaxVelocity`` must not move farther in a sub-step than the outlines reach together: the
    discs of two bodies, the discs of a thing and a tile, or the shortest way through the middle of a hull, over which a thing's
    centre goes. What is not mobile, and by no rule becomes so, stays. A world whose limit does not take ``MaxVelocity`` bounds
    no speed, and is not checked; nor are distances that a rule or task computes by itself, and things that are neither bodies
    nor tiles.

    Args:
        sub_steps: of a step, to say how many are needed.
        unit: what each of the levels is, for the message.
    """
    layout, changes = levels.layout, {factor for rule in world.rules for factor in rule.changes}
    bounded = world.limit is not None and language.MaxVelocity in world.limit.parameters
    if not bounded or language.Position not in changes or not {language.Position, language.Size} <= {*layout.columns}:
        return
    speed, rate = (levels.parameters[:, layout.parameters.index(p)] for p in (language.MaxVelocity, language.Framerate))
    is_hull, size = levels.shape_kind == language.HULL, levels.values[:, :, layout.columns[language.Size]]
    extent, through = np.where(is_hull, 2 * hull_radii(levels), size), np.full(size.shape, np.inf)
    if is_hull.any():
        through[is_hull] = _ways_through(levels.vertices[is_hull], levels.vertex_count[is_hull])
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
        over = placed[:, i] & placed[:, j] & (tile[:, i] != tile[:, j])
        meeting = solid[:, i] & solid[:, j] & placed[:, i] & placed[:, j]
        reach = np.where(over | meeting, extent[:, i] + extent[:, j], np.inf)
        mixed = over & (np.isinf(through[:, i]) | np.isinf(through[:, j]))  # two hulls overlap where their discs do
        reach = np.where(mixed, np.minimum(reach, np.minimum(through[:, i], through[:, j])), reach)
        way = speed / rate * (moving[:, i].astype(float) + moving[:, j])
        for level in np.flatnonzero(way > reach * (1 + 1e-9))[:1]:
            needed = math.ceil(sub_steps * way[level] / reach[level])
            raise LevelError(
                f"{unit} {level}: '{layout.names[i]}' and '{layout.names[j]}' can pass each other unseen: at MaxVelocity"
                f" {speed[level]:g} m/s they come {way[level]:g} m nearer in a sub-step of {1 / rate[level]:g} s, and may come"
                f" {reach[level]:g} m. Let the levels have a MaxVelocity of at most"
                f" {0.99 * speed[level] * reach[level] / way[level]:.3g}, or a Framerate of"
                f" {rate[level] * needed / sub_steps:.9g} with a task of sub_steps={needed}, which keeps the time of a step"
            )


def hull_radii(levels: LevelData) -> np.ndarray:
    """Radius of the disc around each hull, which contacts take, 0 of others, float64 ``(n, entities)`` [m]."""
    return np.sqrt((levels.vertices**2).sum(-1)).max(-1, initial=0.0)


def _ways_through(hulls: np.ndarray, counts: np.ndarray) -> np.ndarray:
    """The shortest way through the middle of hulls ``[hull, room, 2]``: the thing's position, or the centre of the area where
    the position is less than half as far from an edge."""
    corners = np.where((np.arange(hulls.shape[1]) < counts[:, None])[..., None], hulls, hulls[:, :1])
    edges = np.roll(corners, -1, axis=1) - corners
    of_position = corners[..., 0] * edges[..., 1] - corners[..., 1] * edges[..., 0]  # distances times lengths of edges
    center = ((corners + edges / 2) * of_position[..., None]).sum(axis=1) / (1.5 * of_position.sum(axis=1)[:, None])
    of_center = of_position - (center[:, :1] * edges[..., 1] - center[:, 1:] * edges[..., 0])
    distance = np.where((of_position >= of_center / 2).all(axis=1)[:, None], of_position, of_center)
    # By direction u, a ray from the middle leaves at 1 / max(n u / d), over edges with normals n at distances d.
    normals = np.stack([edges[..., 1], -edges[..., 0]])
    x, y = np.divide(normals, distance, out=np.zeros(normals.shape), where=distance > 0)
    rays = (np.cos(turn) * x + np.sin(turn) * y for turn in np.arange(DIRECTIONS) * np.pi / DIRECTIONS)
    return np.min([1 / ray.max(axis=1) - 1 / ray.min(axis=1) for ray in rays], axis=0)
