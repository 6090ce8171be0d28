"""States as tensors and plain data, so that a checkpoint can hold them without pickled objects."""

import dataclasses
from collections.abc import Mapping
from copy import deepcopy
from typing import Any, ClassVar, TypeVar

import numpy as np
import torch
from torch.utils._pytree import tree_map

T = TypeVar("T")


class SavedState:
    """What has a state: the attributes that ``saved`` names, and the states of the parts that ``parts`` names, but for those
    that are None."""

    saved: ClassVar[tuple[str, ...]] = ()
    parts: ClassVar[tuple[str, ...]] = ()

    def state_dict(self) -> dict[str, Any]:
        """The state, which goes into the checkpoint."""
        parts = {name: part.state_dict() for name in self.parts if (part := getattr(self, name)) is not None}
        return {**{name: getattr(self, name) for name in self.saved}, **parts}

    def load_state_dict(self, state: Mapping[str, Any]) -> None:
        """Continues from ``state``."""
        for name in self.saved:
            setattr(self, name, deepcopy(state[name]))
        for name in self.parts:
            if (part := getattr(self, name)) is not None:
                part.load_state_dict(state[name])


def as_tensors(snapshot: Any) -> dict[str, Any]:
    """A copy of a snapshot (a dataclass of arrays, numbers, dicts and such dataclasses) as nested dicts of tensors."""
    return tensors_in(dataclasses.asdict(snapshot))


def tensors_in(data: Any) -> Any:
    """Nested plain data with tensors in place of arrays, which they share their memory with."""
    return tree_map(lambda leaf: torch.from_numpy(leaf) if isinstance(leaf, np.ndarray) else leaf, data)


def arrays_in(data: Any) -> Any:
    """Nested plain data with copies as arrays in place of tensors."""
    return tree_map(lambda leaf: leaf.numpy().copy() if isinstance(leaf, torch.Tensor) else leaf, data)


def from_tensors(template: T, data: dict[str, Any]) -> T:
    """The snapshot that was given to :func:`as_tensors`; ``template`` is any snapshot of the same environment."""
    changes = {}
    for field in dataclasses.fields(template):  # type: ignore[arg-type]
        old, new = getattr(template, field.name), data[field.name]
        changes[field.name] = from_tensors(old, new) if dataclasses.is_dataclass(old) else arrays_in(new)
    return dataclasses.replace(template, **changes)  # type: ignore[type-var]
