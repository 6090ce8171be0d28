"""Observations of one array, or of tuples and dicts of them, handled alike."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
from gymnasium import spaces


def build(space: spaces.Space, make: Callable[[spaces.Box], np.ndarray]) -> Any:
    """The tuples and dicts of a space with ``make(box)`` in the place of each box."""
    if isinstance(space, spaces.Dict):
        return {name: build(part, make) for name, part in space.items()}
    if isinstance(space, spaces.Tuple):
        return tuple(build(part, make) for part in space)
    assert isinstance(space, spaces.Box)
    return make(space)


def empty_batch(space: spaces.Space, num_envs: int) -> Any:
    """Arrays for the observations of ``num_envs`` environments, not filled."""
    return build(space, lambda box: np.empty((num_envs, *box.shape), box.dtype))


def leaves(tree: Any) -> Iterator[np.ndarray]:
    """The arrays of an observation, in the order of its members."""
    if isinstance(tree, (dict, tuple)):
        for part in tree.values() if isinstance(tree, dict) else tree:
            yield from leaves(part)
    else:
        yield tree


def map_leaves(function: Callable[[np.ndarray], Any], tree: Any) -> Any:
    """The same tuples and dicts with ``function`` of each array in its place."""
    if isinstance(tree, dict):
        return {name: map_leaves(function, part) for name, part in tree.items()}
    if isinstance(tree, tuple):
        return tuple(map_leaves(function, part) for part in tree)
    return function(tree)
