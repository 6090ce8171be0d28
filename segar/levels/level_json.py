"""Level files in JSON: a text that people can read and edit, which holds the same levels as an npz file to the bit.

Numbers stand in the shortest form that gives the same float64 back. Some parts may be left out, because people write such
files too. Whatever does not belong into a level file is refused, and the message says where it stands.
"""

import json
import math
from collections.abc import Collection, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from segar.errors import LevelError, did_you_mean
from segar.language import CIRCLE, HULL, Entity, FloorFriction, Friction, GlobalFriction, Layout, Shape
from segar.levels.description import DESCRIPTION, description_of, layout_of, origin_of
from segar.levels.level_data import LevelData
from segar.levels.validity import level_forms
from segar.rules import World
from segar.support import __version__, check_form, check_size, data_in, from_handwritten_json, replacing, shown

SUFFIX = ".json"
FORMAT, VERSION = "segar-levels", 1
MOST_VERTICES = np.iinfo(np.int16).max
SHAPES = {None: 0, "circle": CIRCLE, "hull": HULL}
NAMES_OF_SHAPES = {kind: name for name, kind in SHAPES.items()}
DEFAULTS: dict[str, Any] = {
    "version": __version__,
    "provenance": {"name": None, "distribution": "", "seed": 0, "split": ""},
    "extra_parameters": [],
    "most_vertices": 0,
}
"""What descriptions say that leave these parts out."""
FORM: dict[str, Any] = {
    f"{key}?" if key in DEFAULTS or key == "factors" else key: form
    for key, form in {**DESCRIPTION, "most_vertices": int}.items()
}
"""The form of a description in JSON. ``most_vertices`` is the room for vertices of each entity, if none here needs it."""
FACTORS = {str: (float, [float])}
ENTITY = {"type": str, "shape?": (str, None), "vertices?": [[float]], "factors": FACTORS, "sampled?": FACTORS}
LEVEL = {"index?": int, "parameters?": {str: float}, "entities": {str: ENTITY}}
FILE = {"format": str, "version": int, "description": FORM, "levels": [LEVEL]}
"""The form of a file; what follows from the entities in it is checked where they are read."""
NUMBER = {"type": "number"}
PAIR = {"type": "array", "items": NUMBER, "minItems": 2, "maxItems": 2}


def is_json(path: Path) -> bool:
    """Whether the name of a level file is that of one in JSON."""
    return path.suffix == SUFFIX


def write_json(path: Path, levels: LevelData) -> None:
    """Write levels to ``path``, by way of a file beside it.

    Raises:
        LevelError: nobody could read the levels from the file, or the system refuses; what stood at ``path`` still stands
            there.
    """
    _check_floor(levels.layout, levels.values, levels.parameters, f"{path}: ")
    description = description_of(levels)
    _check_texts(description, f"{path}: ")
    if levels.vertices.shape[2] != levels.vertex_count.max():
        description["most_vertices"] = levels.vertices.shape[2]
    described = ",\n".join(f"  {_text(key)}: {_in_lines(value)}" for key, value in description.items())
    listed = ",\n".join(_lines_of_level(levels, i) for i in range(len(levels)))
    text = f'{{"format": "{FORMAT}", "version": {VERSION},\n "description": {{\n{described}}},\n "levels": [\n{listed}]}}\n'
    with replacing(path, "levels", LevelError) as beside:
        beside.write_text(text, encoding="ascii")


def read_json(path: Path, world: World | None) -> LevelData:
    """The levels that a file holds.

    Raises:
        LevelError: there is no such file, it is no JSON, or as :func:`levels_of`.
    """
    data = data_in(path, "a level file in JSON", LevelError, from_handwritten_json)
    return levels_of(data, path, "", world)


def levels_of(data: Any, path: Path, inside: str, world: World | None) -> LevelData:
    """The levels that the data of a level file say.

    What is left out has its default. Arrays have the right forms; :func:`check_levels` checks their numbers.

    Args:
        inside: where the data stand in the file ``path``, for messages; empty, or such as ``levels.``.
        world: the rules of the levels; None for the default ones.

    Raises:
        LevelError: a part is absent, unknown or of another form; the message names it. Or the levels would take more
            memory than the limit.
    """
    where = f"{path}: {inside}"
    check_form(where.rstrip(".: "), data, "a level file in JSON", FORMAT, VERSION, FILE, LevelError)
    said = data["description"]
    _check_texts(said, where)
    description = DEFAULTS | said
    layout, listed = layout_of(description, path, world), data["levels"]
    room = _room(listed, layout, description["most_vertices"], path, where)
    origin = origin_of(description, layout, np.arange(len(listed)), path)
    levels = LevelData.empty(room, **origin, world=world)
    levels.sampled_values[:] = np.nan
    for i, level in enumerate(listed):
        _read_level(f"{where}levels[{i}]", level, i, levels)
    _check_floor(layout, levels.values, levels.parameters, where)
    return levels


def level_schema(layout: Layout | None = None) -> dict[str, Any]:
    """The JSON Schema of level files, for editors and validators; with the entities and factors of a layout where one is given.

    It says what has which form. What only SEGAR knows, such as the range of a factor, is checked when a file is read.
    """
    parameters: dict[str, Any] = {"type": "object", "additionalProperties": NUMBER}
    entities: dict[str, Any] = {"type": "object", "additionalProperties": _entity_schema(None)}
    if layout is not None:
        parameters = _closed({p.__name__: NUMBER for p in layout.parameters}, ())
        slots = {s.name: {"anyOf": [_entity_schema(kind) for kind in s.types]} for s in layout.slots}
        entities = _closed(slots, [s.name for s in layout.slots[:-1] if not s.optional])
    level = _closed(
        {"index": {"type": "integer", "minimum": 0}, "parameters": parameters, "entities": entities}, ["entities"]
    )
    parts = {
        "format": {"const": FORMAT},
        "version": {"type": "integer", "minimum": 1, "maximum": VERSION},
        "description": _schema(FORM),
        "levels": {"type": "array", "minItems": 1, "items": level},
    }
    head = {"$schema": "https://json-schema.org/draft/2020-12/schema", "title": "levels of SEGAR"}
    return head | _closed(parts, list(parts))


def _entity_schema(kind: type[Entity] | None) -> dict[str, Any]:
    """The schema of an entity, of any type or of one."""
    hull = {"type": "array", "items": PAIR, "minItems": 3, "maxItems": int(MOST_VERTICES)}
    factors: dict[str, Any] = {"type": "object", "additionalProperties": {"anyOf": [NUMBER, PAIR]}}
    sampled, name, shapes = factors, {"type": "string"}, list(SHAPES)
    if kind is not None:
        of_kind = {f.__name__: NUMBER if f.width == 1 else PAIR for f in kind.declared if f.width}
        factors, sampled, name = _closed(of_kind, list(of_kind)), _closed(of_kind, ()), {"const": kind.__name__}
        shapes = [shape for shape in SHAPES if (shape is None) == (Shape not in kind.declared)]
    parts = {"type": name, "shape": {"enum": shapes}, "vertices": hull, "factors": factors, "sampled": sampled}
    return _closed(parts, ["type", "factors"])


def _closed(parts: Mapping[str, Any], needed: Collection[str]) -> dict[str, Any]:
    """The schema of a mapping that has these parts and no others."""
    return {"type": "object", "properties": dict(parts), "required": list(needed), "additionalProperties": False}


def _schema(form: Any) -> dict[str, Any]:
    """The schema of a form of :func:`segar.support.misfit`."""
    if isinstance(form, tuple):
        return {"anyOf": [_schema(one) for one in form]}
    if isinstance(form, list):
        return {"type": "array", "items": _schema(form[0])}
    if isinstance(form, Mapping):
        parts = {key.removesuffix("?"): _schema(one) for key, one in form.items()}
        return _closed(parts, [key for key in form if not key.endswith("?")])
    return {"type": {None: "null", str: "string", bool: "boolean", int: "integer", float: "number"}[form]}


# Writing.


def _in_lines(value: Any) -> str:
    """A part of the description: on one line, or with one line for each thing that it lists."""
    if not (isinstance(value, list) and value and isinstance(value[0], dict)):
        return _text(value)
    return "[\n" + ",\n".join(f"   {_text(one)}" for one in value) + "]"


def _lines_of_level(levels: LevelData, i: int) -> str:
    """One level, with one line for each entity."""
    parameters = {p.__name__: x for p, x in zip(levels.layout.parameters, levels.parameters[i].tolist(), strict=True)}
    entities = ",\n".join(
        f"    {_text(levels.layout.names[k])}: {_text(_entity(levels, i, k))}"
        for k in np.flatnonzero(levels.types[i] >= 0).tolist()
    )
    index = int(levels.provenance.indices[i])
    return f'  {{"index": {index},\n   "parameters": {_text(parameters)},\n   "entities": {{\n{entities}}}}}'


def _entity(levels: LevelData, i: int, k: int) -> dict[str, Any]:
    """The entity in slot ``k`` of level ``i``."""
    layout, values, sampled = levels.layout, levels.values[i, k], levels.sampled_values[i, k]
    kind = layout.types[levels.types[i, k]]
    made: dict[str, Any] = {"type": kind.__name__, "shape": NAMES_OF_SHAPES[int(levels.shape_kind[i, k])]}
    if made["shape"] == "hull":
        made["vertices"] = levels.vertices[i, k, : levels.vertex_count[i, k]].tolist()
    parts = {f: layout.columns_of(f) for f in layout.columns if f in kind.declared}
    made["factors"] = {f.__name__: _numbers(values[part]) for f, part in parts.items()}
    moved = {f: part for f, part in parts.items() if values[part].tobytes() != sampled[part].tobytes()}
    if moved:
        made["sampled"] = {f.__name__: _numbers(sampled[part]) for f, part in moved.items()}
    return made


def _numbers(values: np.ndarray) -> float | list[float]:
    """The value of a factor: a number, or a list of two."""
    return float(values[0]) if len(values) == 1 else values.tolist()


def _text(value: Any) -> str:
    return json.dumps(value, allow_nan=False)


# Reading. ``at`` is where something stands, with the file's name.


def _room(listed: list[Any], layout: Layout, most_vertices: int, path: Path, where: str) -> int:
    """Room for the vertices of each entity of the levels that are listed; raises :class:`LevelError` where the arrays of these
    would be larger than the limit."""
    if not listed:
        raise LevelError(f"{where}levels: must be a list of at least one level, and is empty")
    if not 0 <= most_vertices <= MOST_VERTICES:
        raise LevelError(f"{where}description.most_vertices: must be 0 to {MOST_VERTICES}, not {most_vertices}")
    hulls = (entity.get("vertices", ()) for level in listed for entity in level["entities"].values())
    room = max([most_vertices, *map(len, hulls)])
    sizes: dict[Any, int] = {"n": len(listed), "V": room}
    size = 0
    for form in level_forms(layout).values():
        axes: list[Any] = [sizes.get(axis, axis) for axis in form.axes]
        size += np.dtype(form.dtype).itemsize * math.prod(axes)
    check_size(path, size, "level file", LevelError)
    return room


def _read_level(at: str, level: Any, i: int, levels: LevelData) -> None:
    """Put level ``i`` into the arrays."""
    layout = levels.layout
    levels.provenance.indices[i] = level.get("index", i)
    given = level.get("parameters", {})
    _check_names(f"{at}.parameters", given, [p.__name__ for p in layout.parameters])
    levels.parameters[i] = [given.get(p.__name__, p.default) for p in layout.parameters]
    _check_names(f"{at}.entities", level["entities"], layout.names)
    for name, entity in level["entities"].items():
        _read_entity(f"{at}.entities.{name}", entity, i, layout.slot_index(name), levels)
    if levels.types[i, -1] < 0:  # the floor, which need not be said: its friction is a parameter
        levels.types[i, -1] = layout.types.index(GlobalFriction)
        floor = levels.parameters[i, layout.parameters.index(FloorFriction)]
        levels.values[i, -1, layout.columns[Friction]] = levels.sampled_values[i, -1, layout.columns[Friction]] = floor
    for k in np.flatnonzero(levels.types[i] < 0).tolist():
        if not layout.slots[k].optional:
            raise LevelError(f"{at}.entities: '{layout.slots[k].name}' is absent, and every level must have it")


def _read_entity(at: str, entity: Any, i: int, k: int, levels: LevelData) -> None:
    """Put the entity in slot ``k`` of level ``i`` into the arrays."""
    layout = levels.layout
    types = {t.__name__: t for t in layout.slots[k].types}
    if entity["type"] not in types:
        raise LevelError(f"{at}.type: must be {' or '.join(types)}, not {shown(entity['type'])}")
    kind = types[entity["type"]]
    levels.types[i, k] = layout.types.index(kind)
    levels.shape_kind[i, k] = shape = _shape(f"{at}.shape", entity.get("shape"), kind)
    if shape == HULL:
        vertices = _vertices(at, entity)
        levels.vertex_count[i, k] = len(vertices)
        levels.vertices[i, k, : len(vertices)] = vertices
    elif "vertices" in entity:
        raise LevelError(f"{at}.vertices: only hulls have vertices, and its 'shape' is {shown(entity.get('shape'))}")
    factors = {f.__name__: f for f in layout.columns if f in kind.declared}
    sampled = entity.get("sampled", {})
    for part, given in (("factors", entity["factors"]), ("sampled", sampled)):
        _check_names(f"{at}.{part}", given, factors)
    for name, factor in factors.items():
        if name not in entity["factors"]:
            raise LevelError(f"{at}.factors: '{name}' is absent, which every {kind.__name__} has")
        part = layout.columns_of(factor)
        levels.values[i, k, part] = value = _value(f"{at}.factors.{name}", entity["factors"][name], factor.width)
        levels.sampled_values[i, k, part] = (
            _value(f"{at}.sampled.{name}", sampled[name], factor.width) if name in sampled else value
        )


def _check_names(at: str, given: Collection[str], known: Collection[str]) -> None:
    """Raise :class:`LevelError` where a name is not one of those that are known."""
    for name in given:
        if name not in known:
            raise LevelError(f"{at}: has no {shown(name)}.{did_you_mean(name, known)}")


def _shape(at: str, given: str | None, kind: type[Entity]) -> int:
    """The code of a shape; none is given where the type has none."""
    known = [name for name in SHAPES if (name is None) == (Shape not in kind.declared)]
    if given not in known:
        must = "'circle' or 'hull'" if Shape in kind.declared else f"null, because a {kind.__name__} has no shape"
        raise LevelError(f"{at}: must be {must}, not {shown(given)}")
    return SHAPES[given]


def _vertices(at: str, entity: Mapping[str, Any]) -> list[list[float]]:
    """The vertices of a hull."""
    given = entity.get("vertices", ())
    if not 3 <= len(given) <= MOST_VERTICES:
        raise LevelError(
            f"{at}.vertices: a hull needs 3 to {MOST_VERTICES} places, counter-clockwise, and there are {len(given)}"
        )
    return [_value(f"{at}.vertices[{j}]", vertex, 2) for j, vertex in enumerate(given)]


def _value(at: str, given: Any, width: int) -> Any:
    """A number, or a list of two numbers."""
    if isinstance(given, list) != (width == 2) or (width == 2 and len(given) != 2):
        raise LevelError(f"{at}: must be {'a list of two numbers' if width == 2 else 'a number'}, not {shown(given)}")
    return given


# What both directions ask for.


def _check_texts(said: Any, where: str) -> None:
    """Raise :class:`LevelError` where a text of the description has more than one line, or characters that none shows."""
    if isinstance(said, str) and not said.isprintable():
        raise LevelError(f"{where}description: {shown(said)} has characters that cannot be printed")
    for part in said.values() if isinstance(said, dict) else said if isinstance(said, list) else ():
        _check_texts(part, where)


def _check_floor(layout: Layout, values: np.ndarray, parameters: np.ndarray, where: str) -> None:
    """Raise :class:`LevelError` where the floor's friction, which rules read, is not the level's parameter."""
    floor, stated = values[:, -1, layout.columns[Friction]], parameters[:, layout.parameters.index(FloorFriction)]
    for i in np.flatnonzero(floor != stated)[:1].tolist():
        name = layout.names[-1]
        raise LevelError(
            f"{where}levels[{i}].entities.{name}.factors.Friction: is {floor[i]!s}, and the parameter FloorFriction is"
            f" {stated[i]!s}; both must be the same number, and in JSON '{name}' may be left out"
        )
