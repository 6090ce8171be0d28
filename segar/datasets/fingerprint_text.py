"""What an observation or a policy is, in words that are the same in every process."""

from __future__ import annotations

import dataclasses
import functools
import hashlib
from collections.abc import Mapping
from typing import Any

import numpy as np

DIGITS = 8


def in_words(thing: Any) -> str:
    """A text that tells two different observations apart: classes and functions by name, arrays by hash.

    Of an object that says nothing about itself, this is its class alone.
    """
    if isinstance(thing, np.ndarray):
        digest = hashlib.sha256(np.ascontiguousarray(thing).tobytes()).hexdigest()[:DIGITS]
        return f"{thing.dtype}{list(thing.shape)}:{digest}"
    if isinstance(thing, functools.partial):
        given = [*map(in_words, thing.args), *(f"{name}={in_words(value)}" for name, value in thing.keywords.items())]
        return f"{in_words(thing.func)}({', '.join(given)})"
    if hasattr(thing, "__qualname__"):
        return f"{thing.__module__}.{thing.__qualname__}"
    if dataclasses.is_dataclass(thing):
        parts = {field.name: getattr(thing, field.name) for field in dataclasses.fields(thing)}
        return f"{type(thing).__name__}({', '.join(f'{name}={in_words(part)}' for name, part in parts.items())})"
    if isinstance(thing, Mapping):
        return f"{{{', '.join(f'{in_words(key)}: {in_words(value)}' for key, value in thing.items())}}}"
    if isinstance(thing, (tuple, list)):
        return f"({', '.join(map(in_words, thing))})"
    words = repr(thing)
    return words if " at 0x" not in words else f"{type(thing).__module__}.{type(thing).__qualname__}"
