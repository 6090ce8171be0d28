"""Observations of one array, or of tuples and dicts of them, handled alike."""

from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
from gymnasium import spaces
from gymnasium.vector.utils import create_empty_array

from segar.observations.protocol import Arrays


def empty_batch(space: spaces.Space, num_envs: int) -> Any:
    """Arrays ``[num_envs, ...]`` for the observations of a batch of environments, not filled."""
    return create_empty_array(space, num_envs, np.empty)


def leaves(tree: Arrays) -> Iterator[np.ndarray]:
    """The arrays of an observation, in the order of its members."""
    if isinstance(tree, (dict, tuple)):
        for part in tree.values() if isinstance(tree, dict) else tree:
            yield from leaves(part)
    else:
        yield tree


def map_leaves(function: Callable[[Any], Any], tree: Any) -> Any:
    """The same tuples and dicts with ``function`` of each array in its place."""
    if isinstance(tree, dict):
        return {name: map_leaves(function, part) for name, part in tree.items()}
    if isinstance(tree, tuple):
        return tuple(map_leaves(function, part) for part in tree)
    return function(tree)
