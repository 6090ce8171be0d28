"""Level sets: initial states as arrays, which can be picked from, made from entities, and kept in files.

Level files are npz archives without pickle, a description in JSON beside the arrays, or one text in JSON. Both are
replaced only when complete.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np

from segar.errors import LevelError, PlacementError
from segar.language import Entity, Layout, Parameter
from segar.levels.description import DESCRIPTION, description_of, layout_of, origin_of
from segar.levels.from_entities import levels_of_entities
from segar.levels.level_data import LEVEL_ARRAYS, LevelData
from segar.levels.level_json import is_json, levels_of, read_json, write_json
from segar.levels.sampling.placement import fix_levels
from segar.levels.validity import check_levels, level_forms
from segar.rules import World
from segar.support import ArchiveFormat, Form, ShownInNotebooks, counted, read_only

FORMAT = ArchiveFormat("segar-levels", 1, "levels", "level file", LevelError, DESCRIPTION)


@dataclass(frozen=True, eq=False, repr=False)
class Levels(LevelData, ShownInNotebooks):
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

    Arrays cannot be written: take a copy, and ``dataclasses.replace(levels, values=copy)``.
    """

    def __post_init__(self) -> None:
        for name in LEVEL_ARRAYS:  # sets are shared, as those of suites are, and others have seen their hash
            object.__setattr__(self, name, read_only(getattr(self, name)))
        indices = read_only(self.provenance.indices)
        object.__setattr__(self, "provenance", dataclasses.replace(self.provenance, indices=indices))

    @classmethod
    def load(cls, path: str | PathLike[str], world: World | None = None) -> Levels:
        """Levels from a file as ``save`` writes it, in ``world`` (None: the default rules; files do not hold rules).

        Raises:
            LevelError: the file is no level file, is incomplete, holds entity types that are not defined, arrays that do
                not fit them or each other, or a number that is not finite or that its factor cannot be; or it would
                expand to more than the limit (see ``docs/reference/files.md``).
        """
        _require_world(world)
        path = Path(path)
        levels = cls(**vars((read_json if is_json(path) else _read_npz)(path, world).closed()))
        check_levels(levels, f"{path}: ")
        return levels

    @classmethod
    def from_entities(
        cls,
        levels: Sequence[Sequence[Entity]],
        parameters: Mapping[type[Parameter], Any] | None = None,
        world: World | None = None,
        fix_overlaps: bool = False,
        name: str | None = None,
    ) -> Levels:
        """Levels made by hand, one sequence of entities each; the k-th entities of all levels share a slot.

        Args:
            levels: entities such as ``GolfBall({Position: [0, 0]})``; levels with fewer leave their last slots empty.
            parameters: world parameter class to a number, or to one number per level; which options of a rule space are
                active, and their constants, are such parameters.
            fix_overlaps: move things out of walls and of each other; by default all stay exactly where they are.

        Raises:
            LevelError: there are no levels, or an entity or parameter cannot be used.
            PlacementError: ``fix_overlaps`` is asked for and impossible.
        """
        drawn = () if world is None or world.space is None else world.space.parameters
        values = {p: p.default for p in drawn} | dict(parameters or {})
        made = cls(**vars(levels_of_entities(levels, values, world, name).closed()))
        check_levels(made, "Levels.from_entities: ")
        return made.without_overlaps() if fix_overlaps else made

    def save(self, path: str | PathLike[str]) -> None:
        """Write the levels to ``path``: in JSON where its name ends in ``.json``, else in npz without pickle.

        Both hold the same levels to the bit. An existing file is replaced only by a complete one.

        Raises:
            LevelError: the file cannot be written, or the levels could not be read from it, such as numbers that are not
                finite; what stood at ``path`` still stands there.
        """
        check_levels(self, "Levels.save: ")
        path = Path(path)
        if is_json(path):
            write_json(path, self)
        else:
            arrays = {name: getattr(self, name) for name in LEVEL_ARRAYS} | {"indices": self.provenance.indices}
            FORMAT.write(path, arrays, description_of(self))

    def with_parameters(self, parameters: np.ndarray) -> Levels:
        """The same levels with other world parameters, float64 ``(n, P)``, which their floors follow; raises
        :class:`LevelError` for another shape."""
        shape = (len(self.values), len(self.layout.parameters))
        if np.shape(parameters) != shape:
            names = ", ".join(one.__name__ for one in self.layout.parameters)
            raise LevelError(f"with_parameters needs {shape} numbers ({names}), not {np.shape(parameters)}")
        values = self.values.copy()
        self.layout.set_floor(values, parameters)
        return dataclasses.replace(self, values=values, parameters=parameters)

    def without_overlaps(self) -> Levels:
        """The same levels with things moved out of walls, and objects out of each other.

        Raises:
            PlacementError: the things of a level do not fit; the message names it.
        """
        fixed = self.writable()
        stuck = fix_levels(fixed)
        if len(stuck):
            raise PlacementError(f"level {stuck[0]}: its things do not fit into the arena without overlap")
        return dataclasses.replace(self, values=fixed.values)

    def __getitem__(self, index: Any) -> Levels:
        """Levels at an index, a slice, or an array of indices or truth values; always levels, never a single array."""
        n = len(self)
        if isinstance(index, (int, np.integer)):
            if not -n <= index < n:
                raise IndexError(f"level {index} is not among these {n} levels")
            index = [int(index)]
        if not isinstance(index, slice) and not np.size(index):
            index = slice(0)  # an empty list has no dtype
        picked: np.ndarray = np.arange(n)[index]
        if picked.ndim != 1 or not len(picked):
            raise LevelError(
                f"levels are picked by an index, a slice or a list of indices, and at least one; not {index!r}"
            )
        return Levels(**vars(self.at(picked).closed()))

    def __iter__(self) -> Iterator[Levels]:
        return (self[i] for i in range(len(self)))

    def __eq__(self, other: object) -> bool:
        """Equal to the bit: layout, all arrays and provenance; not the distribution and world objects."""
        if not isinstance(other, Levels):
            return NotImplemented
        pairs = ((getattr(self, field), getattr(other, field)) for field in LEVEL_ARRAYS)
        same = all(a.dtype == b.dtype and a.shape == b.shape and a.tobytes() == b.tobytes() for a, b in pairs)
        return same and self.layout == other.layout and self.provenance == other.provenance

    def __repr__(self) -> str:
        p = self.provenance
        origin = (
            f"of '{p.name}'" if p.name else f"of distribution {p.distribution}" if p.distribution else "made by hand"
        )
        drawn = f", seed {p.seed}, split '{p.split}'" if p.distribution else ""
        return f"<{counted(len(self), 'level')} {origin}{drawn}>"


def levels_from_data(data: Any, path: Path, inside: str, world: World | None) -> Levels:
    """Levels from the data of a level file in JSON that is a part of another file.

    Args:
        path: the file that it is a part of.
        inside: where in that file, for messages; such as ``levels.``.
        world: as :meth:`Levels.load` takes it.

    Raises:
        LevelError: as :meth:`Levels.load`.
    """
    _require_world(world)
    levels = Levels(**vars(levels_of(data, path, inside, world)))
    check_levels(levels, f"{path}: {inside}")
    return levels


def _require_world(world: Any) -> None:
    if not isinstance(world, World | None):
        raise LevelError(
            f"world must be a segar.World or None, not {world!r}; World(...) makes one of rules or a rule space"
        )


def _read_npz(path: Path, world: World | None) -> LevelData:
    """The levels that an npz file holds; the arrays have the right forms."""
    layouts: list[Layout] = []

    def forms(description: dict[str, Any]) -> Mapping[str, Form]:
        layouts.append(layout_of(description, path, world))
        return level_forms(layouts[0])

    found, description = FORMAT.read(path, forms)
    arrays: dict[str, Any] = found
    origin = origin_of(description, layouts[0], arrays.pop("indices"), path)
    return LevelData(**origin, **arrays, world=world)
