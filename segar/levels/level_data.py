"""What a set of levels consists of: its arrays, and where they come from.

The fields of levels stand here, apart from the methods of :class:`segar.Levels`: these methods draw, save and change
levels through modules that take the fields as arguments.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np

from segar.language import Layout
from segar.rules import World

LEVEL_ARRAYS = (
    "types",
    "values",
    "shape_kind",
    "vertex_count",
    "vertices",
    "parameters",
    "sampled_values",
)


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

    def __len__(self) -> int:
        return len(self.types)
