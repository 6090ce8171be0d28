"""What a snapshot holds for an observation: arrays that are looked up by name and checked."""

from collections.abc import Mapping

import numpy as np

from segar.errors import SegarError


def checked_memory(memory: Mapping[str, np.ndarray], name: str, like: np.ndarray) -> np.ndarray | None:
    """The array of this name, or None where the environment of the snapshot did not remember it.

    Raises:
        SegarError: the array has not the shape and dtype of ``like``, because another observation remembered it.
    """
    if name not in memory:
        return None
    found = memory[name]
    if found.shape != like.shape or found.dtype != like.dtype:
        raise SegarError(
            f"this snapshot was taken under another observation: its '{name}' is {found.dtype} {found.shape[1:]} per"
            f" environment, and here it is {like.dtype} {like.shape[1:]}; make the environment with that observation, or"
            " drop what it remembers: replace(snapshot, memory={})"
        )
    return found
