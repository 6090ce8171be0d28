"""Arrays for observations that nobody else holds: fresh memory costs as much as drawing into it."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from typing import Any

import gymnasium
import numpy as np

from segar.observations import build, empty_batch, leaves

MAX_BUFFERS = 4  # observations that are kept for use again
UNSHARED = 3  # reference count of an array that only the list of a buffer, the loop and getrefcount hold


class Buffers:
    """Memory for the observations of one batch of environments.

    Args:
        copy: whether observations are the caller's to keep; otherwise later ones overwrite them.
        observation: what writes them; where they are not the caller's, and it keeps arrays of its own, these are used
            (:class:`segar.observations.protocol.Keeps`).
    """

    def __init__(self, num_envs: int, copy: bool, observation: Any) -> None:
        space = observation.space
        self._space, self._num_envs = space, num_envs
        self._keeper = observation if not copy and getattr(observation, "kept", None) is not None else None
        self._is_array = isinstance(space, gymnasium.spaces.Box)
        self._always = empty_batch(space, num_envs) if not copy and self._keeper is None else None
        self._outputs: list[list[np.ndarray]] = []
        self._finals: list[tuple[list[np.ndarray], np.ndarray]] = []

    def output(self) -> Any:
        """Arrays to write observations into, ``[num_envs, ...]``."""
        if self._keeper is not None:
            return self._keeper.kept
        if self._always is not None:
            return self._always
        for arrays in self._outputs:
            if _is_free(arrays):
                return self._assemble(arrays)
        fresh = list(leaves(empty_batch(self._space, self._num_envs)))
        self._outputs = [*self._outputs[-(MAX_BUFFERS - 1) :], fresh]
        return self._assemble(fresh)

    def final_output(self, rows: np.ndarray) -> Any:
        """Arrays for final observations, zero but for ``rows``."""
        for index, (arrays, filled) in enumerate(self._finals):
            if _is_free(arrays):
                for array in arrays:
                    array[filled] = 0
                self._finals[index] = (arrays, rows)
                return self._assemble(arrays)
        zeros = build(self._space, lambda box: np.zeros((self._num_envs, *box.shape), box.dtype))
        fresh = list(leaves(zeros))
        self._finals = [*self._finals[-(MAX_BUFFERS - 1) :], (fresh, rows)]
        return self._assemble(fresh)

    def _assemble(self, arrays: Sequence[np.ndarray]) -> Any:
        """The arrays as the space has them."""
        if self._is_array:
            return arrays[0]
        given = iter(arrays)
        return build(self._space, lambda _: next(given))


def _is_free(arrays: Sequence[np.ndarray]) -> bool:
    """Whether nobody but these buffers holds any of the arrays."""
    for array in arrays:  # noqa: SIM110 - a generator would hold one more reference
        if sys.getrefcount(array) != UNSHARED:
            return False
    return True
