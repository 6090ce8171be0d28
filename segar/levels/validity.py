"""Whether levels are what compiled code takes for granted: the forms of their arrays, and the range of each number."""

from collections.abc import Mapping

import numpy as np

from segar.errors import LevelError
from segar.language import CIRCLE, HULL, LARGEST, Factor, Layout, Shape, polygon_areas
from segar.levels.level_data import LevelData
from segar.support import Form


def level_forms(layout: Layout) -> Mapping[str, Form]:
    """What the arrays of levels must be, by name: ``n`` levels, with room for ``V`` vertices."""
    entities, width = len(layout.slots), layout.width
    return {
        "types": Form("int16", ("n", entities)),
        "values": Form("float64", ("n", entities, width)),
        "shape_kind": Form("int8", ("n", entities)),
        "vertex_count": Form("int16", ("n", entities)),
        "vertices": Form("float64", ("n", entities, "V", 2)),
        "parameters": Form("float64", ("n", len(layout.parameters))),
        "sampled_values": Form("float64", ("n", entities, width)),
        "indices": Form("int64", ("n",)),
    }


def check_levels(levels: LevelData, where: str = "") -> None:
    """Raise :class:`LevelError` unless the arrays of levels fit their layout and each other, and their numbers are possible.

    Args:
        where: the start of the message, such as ``levels.npz:``.

    Every entity is of a type that its slot may hold, and has exactly the factors of its type. Each factor and world
    parameter has a value that :meth:`segar.Factor.is_possible` allows, in ``values`` and ``sampled_values``. A hull has
    three vertices or more, counter-clockwise.
    """
    _check_forms(levels, where)
    if not len(levels):
        raise LevelError(f"{where}there are no levels in the set")
    _check_types(levels, where)
    for name in ("values", "sampled_values"):
        _check_values(levels, name, where)
    _check_outlines(levels, where)
    for column, parameter in enumerate(levels.layout.parameters):
        numbers = levels.parameters[:, column]
        for level in np.flatnonzero(~parameter.is_possible(numbers))[:1]:
            raise LevelError(
                f"{where}level {level}: the world parameter {parameter.__name__} is {numbers[level]:g} and must be"
                f" {parameter.possible_values()}"
            )
    for level in np.flatnonzero(levels.provenance.indices < 0)[:1]:
        raise LevelError(f"{where}level {level}: its index in the split is {levels.provenance.indices[level]}, below 0")


def _check_forms(levels: LevelData, where: str) -> None:
    sizes: dict[str, int] = {}
    for name, form in level_forms(levels.layout).items():
        array = levels.provenance.indices if name == "indices" else getattr(levels, name)
        if not isinstance(array, np.ndarray) or not form.fits(array.dtype, array.shape, sizes):
            found = f"{array.dtype} of shape {array.shape}" if isinstance(array, np.ndarray) else type(array).__name__
            raise LevelError(f"{where}the array '{name}' must be {form.said(sizes)}, not {found}")


def _check_types(levels: LevelData, where: str) -> None:
    """Entities are of the types of their slots, and absent only where the slot may stay empty."""
    layout = levels.layout
    allowed = np.array([[*(t in slot.types for t in layout.types), slot.optional] for slot in layout.slots])
    known = (levels.types >= -1) & (levels.types < len(layout.types))
    fits = known & allowed[np.arange(len(layout.slots)), np.where(known, levels.types, -1)]
    for level, slot in np.argwhere(~fits)[:1]:
        place = layout.slots[slot]
        numbers = ", ".join(f"{layout.types.index(t)} ({t.__name__})" for t in place.types)
        raise LevelError(
            f"{where}level {level}: the type of '{place.name}' is {levels.types[level, slot]} and must be {numbers}"
            + (" or -1 (absent)" if place.optional else "")
        )


def _check_values(levels: LevelData, name: str, where: str) -> None:
    """Entities have the factors of their types and no others, with values that these can have."""
    layout, array = levels.layout, getattr(levels, name)
    for factor in layout.columns:
        numbers = array[:, :, layout.columns_of(factor)]
        has = per_type(levels, factor)
        wrong = np.where(has[..., None], ~factor.is_possible(numbers), ~np.isnan(numbers)).any(axis=2)
        for level, slot in np.argwhere(wrong)[:1]:
            shown = ", ".join(f"{x:g}" for x in numbers[level, slot])
            of = "" if name == "values" else f" in '{name}'"
            must = factor.possible_values() if has[level, slot] else "nan, because the entity has no such factor"
            raise LevelError(
                f"{where}level {level}: {factor.__name__} of '{layout.names[slot]}' is {shown}{of} and must be {must}"
            )


def _check_outlines(levels: LevelData, where: str) -> None:
    """Things have a circle or a hull, other entities have no shape, and hulls enclose an area."""
    kind, count = levels.shape_kind, levels.vertex_count
    fits = np.where(per_type(levels, Shape), (kind == CIRCLE) | (kind == HULL), kind == 0)
    for level, slot in np.argwhere(~fits)[:1]:
        raise LevelError(
            f"{where}level {level}: the shape kind of '{levels.layout.names[slot]}' is {kind[level, slot]} and must be"
            f" {CIRCLE} (circle) or {HULL} (hull) for what has a shape, and 0 for what has none"
        )
    room, is_hull = levels.vertices.shape[2], kind == HULL
    for level, slot in np.argwhere(np.where(is_hull, (count < 3) | (count > room), count != 0))[:1]:
        raise LevelError(
            f"{where}level {level}: '{levels.layout.names[slot]}' has {count[level, slot]} vertices, and a hull must have 3"
            f" to {room} here, and everything else 0"
        )
    hulls, counts = levels.vertices[is_hull], count[is_hull]
    for hull in np.flatnonzero(~_encloses(hulls, counts))[:1]:
        level, slot = np.argwhere(is_hull)[hull]
        raise LevelError(
            f"{where}level {level}: the vertices of '{levels.layout.names[slot]}' must be finite and counter-clockwise"
            " around an area"
        )


def _encloses(hulls: np.ndarray, counts: np.ndarray) -> np.ndarray:
    """Whether vertices ``[hull, room, 2]`` are finite and counter-clockwise around an area."""
    used = np.arange(hulls.shape[1]) < counts[:, None]
    finite = ((np.abs(hulls) <= LARGEST) | ~used[..., None]).all(axis=(1, 2))
    corners = np.where((used & finite[:, None])[..., None], hulls, 0.0)
    return finite & (polygon_areas(corners, counts) > 0.0)


def per_type(levels: LevelData, factor: type[Factor]) -> np.ndarray:
    """Which entities are of a type that declares the factor, bool ``(n, entities)``."""
    return np.array([*(factor in t.declared for t in levels.layout.types), False])[levels.types]
