"""What a set of levels consists of: its arrays, and where they come from."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from segar.language import Layout

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
    """Where levels come from: distribution (name and content hash), version, seed, split, and indices in the split.

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


@dataclass(frozen=True, eq=False, repr=False)
class LevelData:
    """The fields of :class:`segar.Levels`, which says what they are."""

    layout: Layout
    types: np.ndarray
    values: np.ndarray
    shape_kind: np.ndarray
    vertex_count: np.ndarray
    vertices: np.ndarray
    parameters: np.ndarray
    sampled_values: np.ndarray
    provenance: Provenance
    distribution: Any = None
    world: Any = None
    task: str | None = None
    moments: Mapping[Any, tuple[np.ndarray, np.ndarray]] = dataclasses.field(default_factory=dict)

    def __len__(self) -> int:
        return len(self.types)
