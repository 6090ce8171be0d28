"""Texts that tell observations and policies apart, and that are the same in every process."""

import dataclasses
import functools
import hashlib
from collections.abc import Mapping
from typing import Any

import numpy as np

DIGITS = 8


def fingerprint_text(thing: Any) -> str:
    """A text that differs for different observations or policies: classes and functions by name, arrays by hash.

    An object whose ``repr`` is an address is described by its class alone.
    """
    if isinstance(thing, np.ndarray):
        digest = hashlib.sha256(np.ascontiguousarray(thing).tobytes()).hexdigest()[:DIGITS]
        return f"{thing.dtype}{list(thing.shape)}:{digest}"
    if isinstance(thing, functools.partial):
        given = [*map(fingerprint_text, thing.args), *_named(thing.keywords, "=")]
        return f"{fingerprint_text(thing.func)}({', '.join(given)})"
    if hasattr(thing, "__qualname__"):
        return f"{thing.__module__}.{thing.__qualname__}"
    if dataclasses.is_dataclass(thing):
        parts = {field.name: getattr(thing, field.name) for field in dataclasses.fields(thing)}
        return f"{type(thing).__name__}({', '.join(_named(parts, '='))})"
    if isinstance(thing, Mapping):
        return f"{{{', '.join(_named({fingerprint_text(key): value for key, value in thing.items()}, ': '))}}}"
    if isinstance(thing, (tuple, list)):
        return f"({', '.join(map(fingerprint_text, thing))})"
    shown = repr(thing)
    return shown if " at 0x" not in shown else f"{type(thing).__module__}.{type(thing).__qualname__}"


def _named(parts: Mapping[str, Any], separator: str) -> list[str]:
    return [f"{name}{separator}{fingerprint_text(part)}" for name, part in parts.items()]
