"""Whether levels of two sets are the same, or nearly so, in what happens in them."""

import numpy as np
from scipy.spatial import KDTree

from segar.errors import LevelError
from segar.language import Acceleration, Density, Drag, Factor, Layout, Order, Parameter
from segar.levels.level_data import LevelData, LevelSource
from segar.levels.moments import moments_of_distribution

WITHOUT_EFFECT: tuple[type[Factor], ...] = (Order, Acceleration, Drag, Density)
"""Factors that do not count: the order of drawing, and quantities that follow from others."""


def near_levels(levels: LevelData, others: LevelData, within: float, source: LevelSource) -> np.ndarray:
    """Which levels have one among ``others`` that is at most ``within`` away; bool ``(len(levels),)``.

    Two levels are compared slot by slot: entity types, shapes with the corners of hulls, all factors but those of
    :data:`WITHOUT_EFFECT`, and world parameters. Their distance is the largest difference of a number, in standard
    deviations under ``source``, or in its own unit where it has no spread. Levels are infinitely far apart where a slot has
    another type or outline, or where they know other factors.

    Args:
        within: 0 asks for equal numbers.
    """
    found = np.zeros(len(levels), np.bool_)
    if not are_comparable(levels.layout, others.layout):
        return found
    mine, theirs = (_by_kind(one) for one in (levels, others))
    rows, other_rows = (_numbers(one, source if within else None) for one in (levels, others))
    for kind, places in mine.items():
        if kind in theirs:
            distance, _ = KDTree(other_rows[theirs[kind]]).query(rows[places], p=np.inf)
            found[places] = distance <= within
    return found


def check_within(within: float) -> None:
    """Raise :class:`LevelError` unless it is a finite number of at least 0."""
    if isinstance(within, bool) or not isinstance(within, (int, float)) or not 0 <= within < np.inf:
        raise LevelError(f"within must be a finite number of standard deviations, at least 0, not {within!r}")


def are_comparable(a: Layout, b: Layout) -> bool:
    """Whether columns and slots of both mean the same."""
    same_columns = a.columns == b.columns and a.parameters == b.parameters
    return same_columns and a.types == b.types and len(a.slots) == len(b.slots)


def _by_kind(levels: LevelData) -> dict[bytes, list[int]]:
    """The levels by what has to be equal in full: types and shapes of all slots, and corners of hulls."""
    corners = np.arange(levels.vertices.shape[2]) < levels.vertex_count[..., None]
    parts = (levels.types, levels.shape_kind, levels.vertex_count, np.where(corners[..., None], levels.vertices, 0.0))
    found: dict[bytes, list[int]] = {}
    for k in range(len(levels)):
        kind = b"|".join(np.ascontiguousarray(part[k]).tobytes().rstrip(b"\0") for part in parts)
        found.setdefault(kind, []).append(k)
    return found


def _numbers(levels: LevelData, source: LevelSource | None) -> np.ndarray:
    """The numbers that count, float64 ``(levels, numbers)``, in standard deviations where a distribution is given; those
    that an entity lacks are 0."""
    layout = levels.layout
    counted = {f: at for f, at in layout.columns.items() if f.width and f not in WITHOUT_EFFECT}
    units = np.ones((len(layout.types) + 1, layout.width))  # the last row is that of absent entities, whose index is -1
    of_parameters = np.ones(len(layout.parameters))
    if source is not None:
        for (kind, factor), (_, variance) in moments_of_distribution(source).items():
            deviation = float(np.sqrt(variance.mean())) or 1.0
            if kind is Parameter and factor in layout.parameters:
                of_parameters[layout.parameters.index(factor)] = deviation
            elif kind in layout.types and factor in counted:
                units[layout.types.index(kind), layout.columns_of(factor)] = deviation
    columns = [at + k for factor, at in counted.items() for k in range(factor.width)]
    values = np.nan_to_num(levels.values, nan=0.0, posinf=0.0, neginf=0.0) / units[levels.types]
    return np.concatenate([values[:, :, columns].reshape(len(levels), -1), levels.parameters / of_parameters], axis=1)
