"""What a set of levels consists of: its arrays, and where they come from.

The fields of levels stand here, apart from the methods of :class:`segar.Levels`: these methods draw, save and change
levels through modules that take the fields as arguments.
"""

from __future__ import annotations

import dataclasses
import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any, Protocol, Self

import numpy as np

from segar.language import BUILT_IN_PARAMETERS, HULL, BaseShape, GlobalFriction, Layout, Parameter, Slot
from segar.rules import World

SPLIT = re.compile(r"\w([\w .-]{0,98}\w)?")
"""What the names of splits are made of, which may become parts of the names of files."""
OUTLINE = ("shape_kind", "vertex_count", "vertices")
"""The arrays that say which shape a thing has."""
LEVEL_ARRAYS = ("types", "values", *OUTLINE, "parameters", "sampled_values")


@dataclass(frozen=True, eq=False)
class Provenance:
    """Where levels come from: distribution (name and content hash), version, seed, split, and int64 indices in the split.

    Levels that were made by hand have an empty ``distribution``. ``rules`` names the rules of their own that levels had
    when they were saved; it is empty for the default ones.
    """

    name: str | None
    distribution: str
    version: str
    seed: int
    split: str
    indices: np.ndarray
    rules: tuple[str, ...] = ()

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, Provenance):
            return NotImplemented
        fields = ("name", "distribution", "version", "seed", "split")
        same = all(getattr(self, f) == getattr(other, f) for f in fields)
        return same and np.array_equal(self.indices, other.indices)


class LevelSource(Protocol):
    """What levels need of the distribution that they are sampled from; :class:`segar.LevelDistribution` is one."""

    def sample(self, n: int, seed: int = 0, split: str = "train") -> LevelData: ...


@dataclass(frozen=True, eq=False, repr=False)
class LevelData:
    """The fields of :class:`segar.Levels`, which documents them."""

    layout: Layout
    types: np.ndarray
    values: np.ndarray
    shape_kind: np.ndarray
    vertex_count: np.ndarray
    vertices: np.ndarray
    parameters: np.ndarray
    sampled_values: np.ndarray
    provenance: Provenance
    distribution: LevelSource | None = None
    world: World | None = None
    task: str | None = None
    moments: Mapping[Any, tuple[np.ndarray, np.ndarray]] = dataclasses.field(default_factory=dict)

    @classmethod
    def empty(cls, vertices: int, layout: Layout, provenance: Provenance, **fields: Any) -> LevelData:
        """Levels with the indices of ``provenance``, in which nothing is set yet, with room for so many vertices."""
        n, entities = len(provenance.indices), len(layout.slots)
        return cls(
            layout=layout,
            provenance=provenance,
            types=np.full((n, entities), -1, dtype=np.int16),
            values=np.full((n, entities, layout.width), np.nan),
            shape_kind=np.zeros((n, entities), dtype=np.int8),
            vertex_count=np.zeros((n, entities), dtype=np.int16),
            vertices=np.zeros((n, entities, vertices, 2)),
            parameters=np.empty((n, len(layout.parameters))),
            sampled_values=np.empty((n, entities, layout.width)),
            **fields,
        )

    def __len__(self) -> int:
        return len(self.types)

    def writable(self, **arrays: np.ndarray) -> LevelData:
        """The same fields with the arrays given, or with copies, which may be written as those of :class:`segar.Levels` may
        not."""
        fields: dict[str, Any] = {name: getattr(self, name).copy() for name in LEVEL_ARRAYS if name not in arrays}
        return LevelData(**{**vars(self), **fields, **arrays})

    def at(self, index: slice | np.ndarray) -> LevelData:
        """Some of the levels; their arrays are views where they are a slice."""
        provenance = dataclasses.replace(self.provenance, indices=self.provenance.indices[index])
        arrays: dict[str, Any] = {name: getattr(self, name)[index] for name in LEVEL_ARRAYS}
        return LevelData(**{**vars(self), **arrays, "provenance": provenance})

    def closed(self) -> Self:
        """The same arrays, which cannot be written from now on: where nobody else has them, :class:`segar.Levels` takes them as
        they are, and copies others."""
        for name in LEVEL_ARRAYS:
            getattr(self, name).flags.writeable = False
        return self

    def set_shape(self, levels: int | np.ndarray, slot: int, shape: BaseShape) -> None:
        """Set the kind of the shape of one slot's things and, unless it is random, its vertices."""
        self.shape_kind[levels, slot] = shape.kind
        if shape.kind == HULL and not shape.is_random:
            self.vertex_count[levels, slot] = len(shape.vertices)
            self.vertices[levels, slot, : len(shape.vertices)] = shape.vertices


def layout_on_floor(slots: Iterable[Slot], parameters: Iterable[type[Parameter]]) -> Layout:
    """The layout of these slots, the arena's floor behind them, and of the parameters that are not built in."""
    extra = tuple(p for p in parameters if p not in BUILT_IN_PARAMETERS)
    return Layout((*slots, Slot("global_friction", (GlobalFriction,))), extra)
