"""Level sets: initial states as arrays, which can be picked from, made from entities, and kept in files.

Level files are npz archives without pickle, a description in JSON beside the arrays, replaced only when complete.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np

from segar.errors import LevelError, PlacementError, did_you_mean
from segar.language import Entity, GlobalFriction, Layout, Parameter, Slot
from segar.levels.from_entities import arrays_of_entities
from segar.levels.level_data import LEVEL_ARRAYS, LevelData, Provenance
from segar.levels.moments import Moments, source_moments
from segar.levels.sampling.placement import fix_block
from segar.levels.validity import check_levels, level_forms
from segar.rules import World
from segar.support import ArchiveFormat, Form

FORMAT = ArchiveFormat("segar-levels", 1, "levels", "level file", LevelError)
ORIGIN = ("name", "distribution", "seed", "split")
CLASS = {"name": str, "module": str, "qualname": str}
DESCRIPTION = {
    "version": str,
    "provenance": {"name": (str, None), "distribution": str, "seed": int, "split": str},
    "task?": (str, None),
    "rules?": [str],
    "slots": [{"name": str, "types": [int], "optional": bool}],
    "types": [CLASS],
    "factors": [CLASS | {"width": int}],
    "extra_parameters": [CLASS],
    "moments?": [
        {"type": (int, None), "factor": str, "mean": [float], "variance": [float]},
    ],
}
"""The form of a level file's description; see :func:`segar.support.misfit`."""


@dataclass(frozen=True, eq=False, repr=False)
class Levels(LevelData):
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

    @classmethod
    def load(cls, path: str | PathLike[str], world: World | None = None) -> Levels:
        """Levels from a file that ``save`` wrote, in ``world`` (None: the default rules; files do not hold rules).

        Raises:
            LevelError: the file is no level file, is incomplete, holds entity types that are not defined, arrays that do
                not fit them or each other, or a number that is not finite or that its factor cannot be; or it would
                expand to more than the limit (see ``docs/reference/files.md``).
        """
        path = Path(path)

        layouts: list[Layout] = []

        def forms(metadata: dict[str, Any]) -> Mapping[str, Form]:
            FORMAT.check(path, metadata, DESCRIPTION)
            layouts.append(_layout(metadata, path))
            return level_forms(layouts[0])

        found, metadata = FORMAT.read(path, forms)
        arrays: dict[str, Any] = found
        layout, rules = layouts[0], tuple(metadata.get("rules", ()))
        origin = {name: metadata["provenance"][name] for name in ORIGIN}
        provenance = Provenance(**origin, version=metadata["version"], indices=arrays.pop("indices"), rules=rules)
        task, moments = metadata.get("task"), _moments(metadata, layout, path)
        levels = cls(**arrays, layout=layout, provenance=provenance, task=task, moments=moments, world=world)
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
            parameters: world parameter class to a number, or to one number per level.
            fix_overlaps: move things out of walls and of each other; by default all stay exactly where they are.

        Raises:
            LevelError: there are no levels, or an entity or parameter cannot be used.
            PlacementError: ``fix_overlaps`` is asked for and impossible.
        """
        made = cls(**arrays_of_entities(levels, parameters or {}, name), world=world)
        check_levels(made, "Levels.from_entities: ")
        return made.without_overlaps() if fix_overlaps else made

    def save(self, path: str | PathLike[str]) -> None:
        """Write the levels to ``path`` (npz without pickle). An existing file is replaced only by a complete one.

        Raises:
            LevelError: the file cannot be written; what stood at ``path`` still stands there.
        """
        arrays = {name: getattr(self, name) for name in LEVEL_ARRAYS} | {"indices": self.provenance.indices}
        FORMAT.write(Path(path), arrays, _metadata(self))

    def without_overlaps(self) -> Levels:
        """The same levels with things moved out of walls, and objects out of each other.

        Raises:
            PlacementError: the things of a level do not fit; the message names it.
        """
        fixed = dataclasses.replace(self, values=self.values.copy())
        stuck = fix_block(fixed.layout, fixed)
        if len(stuck):
            raise PlacementError(f"level {stuck[0]}: its things do not fit into the arena without overlap")
        return fixed

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


def _metadata(levels: Levels) -> dict[str, Any]:
    layout, origin = levels.layout, levels.provenance
    return {
        "version": origin.version,
        "provenance": {name: getattr(origin, name) for name in ORIGIN},
        "task": levels.task,
        "rules": [r.where for r in levels.world.rules] if levels.world is not None else list(origin.rules),
        "slots": [
            {"name": s.name, "types": [layout.types.index(t) for t in s.types], "optional": s.optional}
            for s in layout.slots
        ],
        "types": [_class_address(t) for t in layout.types],
        "factors": [_class_address(f) | {"width": f.width} for f in layout.factors],
        "extra_parameters": [_class_address(p) for p in layout.extra_parameters],
        "moments": [
            {
                "type": layout.types.index(kind) if kind in layout.types else None,
                "factor": factor.__name__,
                "mean": mean.tolist(),
                "variance": variance.tolist(),
            }
            for (kind, factor), (mean, variance) in source_moments(levels).items()
        ],
    }


def _class_address(cls: type) -> dict[str, Any]:
    return {"name": cls.__name__, "module": cls.__module__, "qualname": cls.__qualname__}


def _layout(metadata: dict[str, Any], path: Path) -> Layout:
    types = [_find(address, all_subclasses(Entity), "entity type", path) for address in metadata["types"]]
    extra = [
        _find(address, all_subclasses(Parameter), "world parameter", path) for address in metadata["extra_parameters"]
    ]
    described = metadata["slots"]
    strange = [s["name"] for s in described if not s["types"] or not all(0 <= k < len(types) for k in s["types"])]
    if strange:
        raise LevelError(f"{path}: the types of the slot '{strange[0]}' are not among its {len(types)}; save it again")
    layout = Layout(
        tuple(Slot(s["name"], tuple(types[k] for k in s["types"]), s["optional"]) for s in described), tuple(extra)
    )
    if layout.types != tuple(types) or len(set(layout.names)) < len(described) or _lacks_floor(layout):
        raise LevelError(
            f"{path}: its slots must have names of their own and end with the arena's floor, and its types stand in the"
            " order of the slots; save the levels again"
        )
    saved = [(f["name"], f["width"]) for f in metadata["factors"]]
    here = [(f.__name__, f.width) for f in layout.factors]
    if saved != here:
        raise LevelError(
            f"{path}: its entities have changed since it was written: it holds the factors"
            f" {', '.join(name for name, _ in saved)}, and here they have {', '.join(name for name, _ in here)}"
        )
    return layout


def _lacks_floor(layout: Layout) -> bool:
    """Whether the last slot is another than the arena's floor, which every level has there."""
    return not layout.slots or layout.slots[-1].types != (GlobalFriction,)


def _moments(metadata: dict[str, Any], layout: Layout, path: Path) -> Moments:
    """Moments of the distribution; files of earlier versions hold none."""
    found: Moments = {}
    for entry in metadata.get("moments", ()):
        kinds: dict[int | None, type] = {None: Parameter, **dict(enumerate(layout.types))}
        known = {f.__name__: f for f in (layout.parameters if entry["type"] is None else layout.factors)}
        kind, factor = kinds.get(entry["type"]), known.get(entry["factor"])
        mean, variance = np.array(entry["mean"]), np.array(entry["variance"])
        if kind is None or factor is None or not len(mean) == len(variance) == factor.width or variance.min() < 0:
            raise LevelError(
                f"{path}: the mean and variance that its description gives for {entry['factor']} do not fit; save the"
                " levels again"
            )
        found[kind, factor] = mean, variance
    return found


def _find(address: dict[str, Any], classes: Iterable[type], kind: str, path: Path) -> type:
    """The class of that module and name, else the only class of that name; the last defined one of several.

    A class of this package is found by its name in whatever module it stands now: modules have moved since 0.1.
    """
    classes = list(classes)
    same_name = [c for c in classes if c.__name__ == address["name"]]
    exact = [c for c in same_name if (c.__module__, c.__qualname__) == (address["module"], address["qualname"])]
    if address["module"].startswith("segar."):
        exact += [c for c in same_name if c.__module__.startswith("segar.")]
    if exact or len(same_name) == 1:
        return (exact or same_name)[-1]
    if same_name:
        modules = ", ".join(sorted({c.__module__ for c in same_name}))
        raise LevelError(
            f"{path}: several {kind}s are called '{address['name']}' ({modules}), and none is that of"
            f" {address['module']}; import that module before loading"
        )
    raise LevelError(
        f"{path} holds the {kind} '{address['name']}', which is not defined; import {address['module']}, or define it,"
        f" before loading (on the command line: --world {address['module']}:...)."
        f"{did_you_mean(address['name'], [c.__name__ for c in classes])}"
    )


def all_subclasses(cls: type) -> list[type]:
    """The classes that inherit from one, in order of definition, each before those that inherit from it."""
    found: dict[type, None] = {}
    for child in cls.__subclasses__():
        found |= {child: None} | dict.fromkeys(all_subclasses(child))
    return list(found)
