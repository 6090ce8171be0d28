"""States of environments as tensors and plain data, so that a checkpoint can hold them without pickled objects."""

from __future__ import annotations

import dataclasses
from typing import Any, TypeVar

import numpy as np
import torch

T = TypeVar("T")


def as_tensors(snapshot: Any) -> dict[str, Any]:
    """A snapshot (a dataclass of arrays, numbers, dicts and such dataclasses) as nested dicts of tensors and numbers."""
    return {field.name: _plain(getattr(snapshot, field.name)) for field in dataclasses.fields(snapshot)}


def from_tensors(template: T, data: dict[str, Any]) -> T:
    """The snapshot that :func:`as_tensors` was given; ``template`` is any snapshot of the same environment."""
    changes = {}
    for field in dataclasses.fields(template):  # type: ignore[arg-type]
        old, new = getattr(template, field.name), data[field.name]
        if dataclasses.is_dataclass(old):
            changes[field.name] = from_tensors(old, new)
        else:
            changes[field.name] = _arrays(new)
    return dataclasses.replace(template, **changes)  # type: ignore[type-var]


def _arrays(value: Any) -> Any:
    if isinstance(value, dict):
        return {name: _arrays(part) for name, part in value.items()}
    return value.numpy().copy() if isinstance(value, torch.Tensor) else value


def _plain(value: Any) -> Any:
    if dataclasses.is_dataclass(value):
        return as_tensors(value)
    if isinstance(value, dict):
        return {name: _plain(part) for name, part in value.items()}
    return torch.from_numpy(value.copy()) if isinstance(value, np.ndarray) else value
