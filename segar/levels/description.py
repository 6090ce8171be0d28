"""What a level file says about its levels: where they come from, and the slots, types, factors and parameters of their layout.

Files in npz and in JSON hold the same description. Classes are named in it, and looked up among those that are defined:
reading a file imports nothing.
"""

from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from segar.errors import LevelError, did_you_mean, naming
from segar.language import Entity, GlobalFriction, Layout, Parameter, Slot, all_subclasses
from segar.levels.level_data import SPLIT, LevelData, Provenance
from segar.levels.moments import Moments, source_moments
from segar.rules import World
from segar.support import shown

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


def description_of(levels: LevelData) -> dict[str, Any]:
    """The description of levels, as plain data of the form :data:`DESCRIPTION`."""
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


def layout_of(description: Mapping[str, Any], path: Path, world: World | None) -> Layout:
    """The layout that a description of the right form names, of the classes that are defined here; of several world parameters
    of one name and module, the one that rules of ``world`` take.

    Raises:
        LevelError: a class is not defined, or has other factors than it had; or the slots are not those of levels.
    """
    types = [_find(address, all_subclasses(Entity), "entity type", path) for address in description["types"]]
    taken = () if world is None else (p for rule in (*world.rules, *world.on_contact) for p in rule.parameters)
    parameters = [*all_subclasses(Parameter), *dict.fromkeys(taken)]
    extra = [_find(address, parameters, "world parameter", path) for address in description["extra_parameters"]]
    described = description["slots"]
    strange = [s["name"] for s in described if not s["types"] or not all(0 <= k < len(types) for k in s["types"])]
    if strange:
        raise LevelError(f"{path}: the types of the slot '{strange[0]}' are not among its {len(types)}; save it again")
    slots = tuple(Slot(s["name"], tuple(types[k] for k in s["types"]), s["optional"]) for s in described)
    with naming(path, LevelError):
        layout = Layout(slots, tuple(extra))
    has_floor = layout.slots and layout.slots[-1].types == (GlobalFriction,)  # as every level has it there
    if layout.types != tuple(types) or len(set(layout.names)) < len(described) or not has_floor:
        raise LevelError(
            f"{path}: its slots must have names of their own and end with the arena's floor, and its types stand in the"
            " order of the slots; save the levels again"
        )
    here = [(f.__name__, f.width) for f in layout.factors]
    saved = [(f["name"], f["width"]) for f in description["factors"]] if "factors" in description else here
    if saved != here:
        raise LevelError(
            f"{path}: its entities have changed since it was written: it holds the factors"
            f" {', '.join(name for name, _ in saved)}, and here they have {', '.join(name for name, _ in here)}"
        )
    return layout


def origin_of(description: Mapping[str, Any], layout: Layout, indices: np.ndarray, path: Path) -> dict[str, Any]:
    """The arguments of :class:`segar.Levels` that are no arrays: layout, provenance, task and moments.

    Raises:
        LevelError: the moments do not fit the layout.
    """
    split = description["provenance"]["split"]
    if split and not SPLIT.fullmatch(split):
        raise LevelError(f"{path}: provenance.split: {shown(split)} names no split; it must be a word such as 'train'")
    provenance = Provenance(
        **{name: description["provenance"][name] for name in ORIGIN},
        version=description["version"],
        indices=indices,
        rules=tuple(description.get("rules", ())),
    )
    moments = _moments(description, layout, path)
    return {"layout": layout, "provenance": provenance, "task": description.get("task"), "moments": moments}


def _class_address(cls: type) -> dict[str, Any]:
    return {"name": cls.__name__, "module": cls.__module__, "qualname": cls.__qualname__}


def _moments(description: Mapping[str, Any], layout: Layout, path: Path) -> Moments:
    """Moments of the distribution; files of earlier versions hold none."""
    found: Moments = {}
    for entry in description.get("moments", ()):
        kinds: dict[int | None, type] = {None: Parameter, **dict(enumerate(layout.types))}
        known = {f.__name__: f for f in (layout.parameters if entry["type"] is None else layout.factors)}
        kind, factor = kinds.get(entry["type"]), known.get(entry["factor"])
        mean, variance = np.array(entry["mean"], float), np.array(entry["variance"], float)
        if kind is None or factor is None or not len(mean) == len(variance) == factor.width or variance.min() < 0:
            raise LevelError(
                f"{path}: the mean and variance that its description gives for {entry['factor']} do not fit; save the"
                " levels again"
            )
        found[kind, factor] = mean, variance
    return found


def _find(address: dict[str, Any], classes: Iterable[type], kind: str, path: Path) -> type:
    """The class of that module and name, else the only class of that name on the same side, SEGAR's or the user's: modules
    may move; the last defined one of several. A user's class never stands for a built-in one, nor the other way round:
    they are different things of one name.
    """
    classes = list(classes)
    same_name = [c for c in classes if c.__name__ == address["name"]]
    exact = [c for c in same_name if (c.__module__, c.__qualname__) == (address["module"], address["qualname"])]
    same_side = [c for c in same_name if _is_built_in(c.__module__) == _is_built_in(address["module"])]
    if exact or len(set(same_side)) == 1:
        return (exact or same_side)[-1]
    if same_name:
        modules = ", ".join(sorted({c.__module__ for c in same_name}))
        raise LevelError(
            f"{path}: it holds the {kind} '{address['name']}' of {address['module']}, and here that name is of {modules};"
            f" import {address['module']} before loading"
        )
    raise LevelError(
        f"{path} holds the {kind} '{address['name']}', which is not defined; import {address['module']}, or define it,"
        f" before loading (on the command line: --world {address['module']}:...)."
        f"{did_you_mean(address['name'], [c.__name__ for c in classes])}"
    )


def _is_built_in(module: str) -> bool:
    """Whether a module is one of this package."""
    return module.startswith("segar.")
