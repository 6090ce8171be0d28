"""Content hashes: what a distribution is made of, as text that is the same on every machine, and its hash."""

import dataclasses
import hashlib
import json
from collections.abc import Mapping
from functools import cached_property, partial
from typing import Any

import numpy as np

from segar.errors import LevelError
from segar.language import BaseShape, Entity, Factor, Relation, Symbol, ThingFactory
from segar.levels.conditional import Dependent
from segar.levels.level_data import LEVEL_ARRAYS, LevelData
from segar.levels.priors import Prior
from segar.noise import Noise

HASH_DIGITS = 16


def content_hash(value: Any, with_classes: bool = True) -> str:
    """Sixteen hexadecimal digits that change when anything changes that ``value`` is made of.

    >>> content_hash(segar.UniformNoise(0, 1)) == content_hash(segar.UniformNoise(0.0, 1.0))
    True
    >>> content_hash(segar.UniformNoise(0, 1)) == content_hash(segar.UniformNoise(0, 2))
    False

    Args:
        with_classes: whether what a factor or entity class declares counts, or its name alone.
    """
    text = json.dumps(describe(value, with_classes), separators=(",", ":"), ensure_ascii=True)
    return hashlib.sha256(text.encode()).hexdigest()[:HASH_DIGITS]


def describe(value: Any, with_classes: bool = True) -> Any:
    """``value`` as lists, texts and numbers: classes by name and content, never by module or memory address.

    Raises:
        LevelError: the value holds something that has no content of its own, such as a function.
    """
    inner = partial(describe, with_classes=with_classes)
    if value is None or isinstance(value, (bool, str)):
        return value
    if isinstance(value, (int, np.integer)):
        return int(value)
    if isinstance(value, (float, np.floating)):
        return repr(float(value))  # shortest text that reads back exactly; json has no infinities
    if isinstance(value, (tuple, list, np.ndarray)):
        return [inner(item) for item in value]
    if isinstance(value, Mapping):
        return sorted(([inner(k), inner(v)] for k, v in value.items()), key=json.dumps)
    if isinstance(value, type):
        return inner(_class_content(value)) if with_classes else value.__name__
    if isinstance(value, Prior):
        return ["Prior", *(inner(getattr(value, f.name)) for f in dataclasses.fields(value))]
    if isinstance(value, Dependent):
        entity = [] if value.of is None else [value.of]
        return ["Dependent", inner(value.law), inner(value.shift), inner(value.scale), *entity]
    if isinstance(value, Relation):
        return ["Relation", inner(value.truth)]
    if isinstance(value, Symbol):
        return [value.op, *map(inner, value.args)]
    if isinstance(value, ThingFactory):
        return ["ThingFactory", inner(value.types), inner(value.probabilities)]
    if isinstance(value, (Noise, BaseShape)):
        return [type(value).__name__, *([name, inner(item)] for name, item in _fields(value))]
    raise LevelError(f"a level distribution cannot be made of {value!r} ({type(value).__name__})")


def _class_content(cls: type) -> list[Any]:
    """The names of a factor's or entity's class and of its parents, and what it declares."""
    parents = [c.__name__ for c in cls.__mro__ if c is not object]
    if issubclass(cls, Factor):
        return [*parents, cls.default, cls.bounds]
    if issubclass(cls, Entity):
        return [*parents, *([f.__name__, value] for f, value in cls.declared.items())]
    return parents


def _fields(value: Any) -> list[tuple[str, Any]]:
    """The fields of a distribution or shape; where its class is no dataclass, all attributes that were set."""
    if dataclasses.is_dataclass(value):
        return [(f.name, getattr(value, f.name)) for f in dataclasses.fields(value)]
    cached = {
        name for cls in type(value).__mro__ for name, item in vars(cls).items() if isinstance(item, cached_property)
    }
    return sorted((name, item) for name, item in vars(value).items() if name not in cached)


def hash_of_levels(levels: LevelData) -> str:
    """Sixteen hexadecimal digits that change with any value of any level."""
    found = hashlib.sha256(repr(levels.layout.names).encode())
    for name in LEVEL_ARRAYS:
        array = np.ascontiguousarray(getattr(levels, name))
        found.update(f"{name} {array.dtype} {array.shape}".encode())
        found.update(array.tobytes())
    return found.hexdigest()[:HASH_DIGITS]
