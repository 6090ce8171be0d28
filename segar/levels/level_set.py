"""Levels: the initial states of a set of levels as arrays, and where they come from."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from os import PathLike
from typing import Any

import numpy as np

from segar.language.layout import Layout
from segar.language.entities import Entity
from segar.errors import LevelError, PlacementError
from segar.language.parameters import Parameter

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
class Levels:
    """``n`` levels with the entity slots of one layout (``E`` slots).

    Attributes:
        layout: what the entity axis and the columns mean.
        types: int16 ``(n, E)``, index in ``layout.types``; -1 where the entity is absent.
        values: float64 ``(n, E, layout.width)``, the initial state; nan where the entity is absent or lacks the factor.
        shape_kind: int8 ``(n, E)``: 0 no shape, 1 circle (its radius is Size / 2), 2 hull.
        vertex_count: int16 ``(n, E)``.
        vertices: float64 ``(n, E, V, 2)``, relative to Position [m], counter-clockwise, zero padded.
        parameters: float64 ``(n, P)``, world parameters in the order of ``layout.parameters``.
        sampled_values: like ``values``, as drawn: before overlaps were fixed, and with the Size that priors drew.
        provenance: where the levels come from.
        distribution: the :class:`segar.LevelDistribution` that they were sampled from, if at hand.
        moments: mean and variance of the factors under that distribution, for levels from a file, which holds no
            distribution: distances keep their units.
        world: the rules, a :class:`segar.World`; None for the default ones. Files do not hold rules.
        task: name of the task that the levels are for; None for PuttPutt.
    """

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

    @classmethod
    def load(cls, path: str | PathLike[str], world: Any = None) -> Levels:
        """Levels from a file that ``save`` wrote, in ``world`` (None: the default rules; files do not hold rules).

        Raises:
            LevelError: the file is no level file, is incomplete, or holds entity types that are not defined.
        """
        from segar.levels.files import load_levels

        return load_levels(path, world)

    @classmethod
    def from_entities(
        cls,
        levels: Sequence[Sequence[Entity]],
        parameters: Mapping[type[Parameter], Any] | None = None,
        world: Any = None,
        fix_overlaps: bool = False,
        name: str | None = None,
    ) -> Levels:
        """Levels made by hand, one sequence of entities each; the k-th entities of all levels share a slot.

        Args:
            levels: entities such as ``GolfBall({Position: [0, 0]})``; levels with fewer leave their last slots empty.
            parameters: world parameter class to a number, or to one number per level.
            fix_overlaps: move things out of walls and of each other; by default all stay exactly where they are.

        Raises:
            LevelError: there are no levels, or an entity or parameter cannot be used.
            PlacementError: ``fix_overlaps`` is asked for and impossible.
        """
        from segar.levels.from_entities import levels_from_entities

        made = levels_from_entities(levels, parameters or {}, world, name)
        return made.without_overlaps() if fix_overlaps else made

    def save(self, path: str | PathLike[str]) -> None:
        """Write the levels to ``path`` (npz without pickle). An existing file is replaced only by a complete one.

        Raises:
            LevelError: the file cannot be written; what stood at ``path`` still stands there.
        """
        from segar.levels.files import save_levels

        save_levels(self, path)

    def without_overlaps(self) -> Levels:
        """The same levels with things moved out of walls, and objects out of each other; see :mod:`segar.levels.sampling.placement`.

        Raises:
            PlacementError: the things of a level do not fit; the message names it.
        """
        from segar.levels.sampling.draws import fix_block

        fixed = dataclasses.replace(self, values=self.values.copy())
        stuck = fix_block(fixed.layout, fixed)
        if len(stuck):
            raise PlacementError(f"level {stuck[0]}: its things do not fit into the arena without overlap")
        return fixed

    def __len__(self) -> int:
        return len(self.types)

    def __getitem__(self, index: Any) -> Levels:
        """Levels at an index, a slice, or an array of indices or truth values; always levels, never a single array."""
        n = len(self)
        if isinstance(index, (int, np.integer)):
            if not -n <= index < n:
                raise IndexError(f"level {index} is not among these {n} levels")
            index = [int(index)]
        if not isinstance(index, slice) and not len(index):
            index = slice(0)  # an empty list has no dtype
        picked: np.ndarray = np.arange(n)[index]
        if picked.ndim != 1 or not len(picked):
            raise LevelError(
                f"levels are picked by an index, a slice or a list of indices, and at least one; not {index!r}"
            )
        arrays = {field: getattr(self, field)[picked] for field in LEVEL_ARRAYS}
        provenance = dataclasses.replace(self.provenance, indices=self.provenance.indices[picked])
        return dataclasses.replace(self, **arrays, provenance=provenance)

    def __iter__(self) -> Iterator[Levels]:
        return (self[i] for i in range(len(self)))

    def __eq__(self, other: object) -> bool:
        """Equal to the bit: layout, all arrays and provenance; not the distribution and world objects."""
        if not isinstance(other, Levels):
            return NotImplemented
        arrays = all(_same_bits(getattr(self, field), getattr(other, field)) for field in LEVEL_ARRAYS)
        return arrays and self.layout == other.layout and self.provenance == other.provenance

    def __repr__(self) -> str:
        p = self.provenance
        origin = (
            f"of '{p.name}'" if p.name else f"of distribution {p.distribution}" if p.distribution else "made by hand"
        )
        drawn = f", seed {p.seed}, split '{p.split}'" if p.distribution else ""
        return f"<{len(self)} levels {origin}{drawn}>"


def _same_bits(a: np.ndarray, b: np.ndarray) -> bool:
    return a.dtype == b.dtype and a.shape == b.shape and a.tobytes() == b.tobytes()
