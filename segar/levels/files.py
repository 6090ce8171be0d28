"""Level files: npz archives without pickle, a description in JSON beside the arrays, replaced only when complete."""

from collections.abc import Iterable
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np

from segar.errors import LevelError, did_you_mean
from segar.language import Entity, Factor, Layout, Parameter, Slot
from segar.levels.level_data import LEVEL_ARRAYS, LevelData, Provenance
from segar.levels.moments import Moments, source_moments
from segar.support import ArchiveFormat

FORMAT = ArchiveFormat("segar-levels", 1, "levels", "level file", LevelError)


def write_level_file(levels: LevelData, path: str | PathLike[str]) -> None:
    """See :meth:`segar.Levels.save`."""
    arrays = {name: getattr(levels, name) for name in LEVEL_ARRAYS} | {"indices": levels.provenance.indices}
    FORMAT.write(Path(path), arrays, _metadata(levels))


def read_level_file(path: str | PathLike[str]) -> dict[str, Any]:
    """The arguments of :class:`segar.Levels`, except the world; see :meth:`segar.Levels.load`."""
    arrays, metadata = FORMAT.read(Path(path), (*LEVEL_ARRAYS, "indices"))
    try:
        layout = _layout(metadata, str(path))
        rules = tuple(metadata.get("rules", ()))
        provenance = Provenance(
            **metadata["provenance"], version=metadata["version"], indices=arrays.pop("indices"), rules=rules
        )
        task, moments = metadata.get("task"), _moments(metadata, layout)
    except (KeyError, IndexError, TypeError, StopIteration) as cause:
        raise LevelError(
            f"{path} is not a level file, or a damaged one: its description does not fit ({cause!r}); save the levels again"
        ) from cause
    return {**arrays, "layout": layout, "provenance": provenance, "task": task, "moments": moments}


def _metadata(levels: LevelData) -> dict[str, Any]:
    layout, origin = levels.layout, levels.provenance
    return {
        "version": origin.version,
        "provenance": {
            "name": origin.name,
            "distribution": origin.distribution,
            "seed": origin.seed,
            "split": origin.split,
        },
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


def _layout(metadata: dict[str, Any], path: str) -> Layout:
    types = [_find(address, _all_subclasses(Entity), "entity type", path) for address in metadata["types"]]
    extra = [
        _find(address, _all_subclasses(Factor), "world parameter", path) for address in metadata["extra_parameters"]
    ]
    slots = (Slot(s["name"], tuple(types[k] for k in s["types"]), s["optional"]) for s in metadata["slots"])
    layout = Layout(tuple(slots), tuple(extra))
    saved = [(f["name"], f["width"]) for f in metadata["factors"]]
    here = [(f.__name__, f.width) for f in layout.factors]
    if saved != here:
        raise LevelError(
            f"{path}: its entities have changed since it was written: it holds the factors"
            f" {', '.join(name for name, _ in saved)}, and here they have {', '.join(name for name, _ in here)}"
        )
    return layout


def _moments(metadata: dict[str, Any], layout: Layout) -> Moments:
    """Moments of the distribution; files of earlier versions hold none."""
    found: Moments = {}
    for entry in metadata.get("moments", ()):
        kind = Parameter if entry["type"] is None else layout.types[entry["type"]]
        known = layout.parameters if entry["type"] is None else layout.factors
        factor = next(f for f in known if f.__name__ == entry["factor"])
        found[kind, factor] = np.array(entry["mean"]), np.array(entry["variance"])
    return found


def _find(address: dict[str, Any], classes: Iterable[type], kind: str, path: str) -> type:
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


def _all_subclasses(cls: type) -> list[type]:
    found: dict[type, None] = {}
    for child in cls.__subclasses__():
        found |= {child: None} | dict.fromkeys(_all_subclasses(child))
    return list(found)
