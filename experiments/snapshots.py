"""States of environments as tensors and plain data, so that a checkpoint can hold them without pickled objects."""

from __future__ import annotations

import dataclasses
from typing import Any, TypeVar

import numpy as np
import torch

T = TypeVar("T")


def as_tensors(snapshot: Any) -> dict[str, Any]:
    """A snapshot (a dataclass of arrays, numbers and such dataclasses) as nested dicts of tensors and numbers."""
    return {field.name: _plain(getattr(snapshot, field.name)) for field in dataclasses.fields(snapshot)}


def from_tensors(template: T, data: dict[str, Any]) -> T:
    """The snapshot that :func:`as_tensors` was given; ``template`` is any snapshot of the same environment."""
    changes = {}
    for field in dataclasses.fields(template):  # type: ignore[arg-type]
        old, new = getattr(template, field.name), data[field.name]
        if dataclasses.is_dataclass(old):
            changes[field.name] = from_tensors(old, new)
        else:
            changes[field.name] = new.numpy().copy() if isinstance(new, torch.Tensor) else new
    return dataclasses.replace(template, **changes)  # type: ignore[type-var]


def _plain(value: Any) -> Any:
    if dataclasses.is_dataclass(value):
        return as_tensors(value)
    return torch.from_numpy(value.copy()) if isinstance(value, np.ndarray) else value
