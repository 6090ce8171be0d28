"""Memory for observations that is used again once no caller holds any of it: fresh memory costs as much as drawing into it."""

from __future__ import annotations

import weakref
from typing import Any

import gymnasium
import numpy as np
from gymnasium.vector.utils import create_empty_array

from segar.observations import Arrays, BoundObservation, leaves, map_leaves, own_arrays

MAX_BUFFERS = 4  # observations whose memory is kept for use again
SMALL = 1 << 16  # bytes of observations whose memory is not: the heap has it at hand


class Buffers:
    """Memory for the observations of one batch of environments.

    Args:
        copy: whether observations are the caller's to keep; otherwise later ones overwrite them.
        observation: the observation that writes into the arrays. Where ``copy`` is false and it has arrays of its own, these
            are used (:func:`segar.observations.own_arrays`).
    """

    def __init__(self, num_envs: int, copy: bool, observation: BoundObservation) -> None:
        self._space, self._num_envs, self._copy, self._observation = observation.space, num_envs, copy, observation
        template: Any = create_empty_array(self._space, num_envs)
        self._small = template if sum(array.nbytes for array in leaves(template)) <= SMALL else None
        self._overwritten: Arrays | None = None if copy or own_arrays(observation) is not None else template
        self._outputs: list[ReusedArrays] = []
        self._finals: list[ReusedArrays] = []

    def output(self) -> Any:
        """Arrays to write observations into, ``[num_envs, ...]``."""
        if self._copy:
            return self._unheld(self._outputs).lend() if self._small is None else map_leaves(np.empty_like, self._small)
        return own_arrays(self._observation) if self._overwritten is None else self._overwritten

    def final_output(self, rows: np.ndarray) -> Any:
        """Arrays for final observations, ``[num_envs, ...]``, which are 0 and to be filled in these rows (int64) alone."""
        arrays = self._unheld(self._finals)
        arrays.clear(rows)
        return arrays.lend()

    def _unheld(self, pool: list[ReusedArrays]) -> ReusedArrays:
        """Arrays of the pool that no caller holds, or new ones, which then belong to it."""
        for arrays in pool:
            if not arrays.are_held():
                return arrays
        pool[:] = [*pool[-(MAX_BUFFERS - 1) :], ReusedArrays(self._space, self._num_envs)]
        return pool[-1]


class Memory(np.ndarray):
    """An array that owns its memory, and whose type is not that of the arrays that are lent.

    NumPy makes a view of a view hold the array that owns the memory, unless that array has another type. Then all views of a
    lent array hold the lent array.
    """


class ReusedArrays:
    """Memory for one batch of observations, which is lent as arrays, and again once the caller holds none of them.

    A weak reference to each lent array says whether it is held: views, tensors and memoryviews of the array keep it alive.
    Counts of references would not say so: since Python 3.14 a variable may hold an array without being counted.
    """

    def __init__(self, space: gymnasium.Space, num_envs: int) -> None:
        self._memory = create_empty_array(space, num_envs, Memory)
        self._lent: list[weakref.ref[np.ndarray]] = []
        self._filled: Any = slice(None)  # rows that may differ from 0

    def are_held(self) -> bool:
        """Whether a caller holds any of the lent arrays, or a view of one."""
        for array in self._lent:  # noqa: SIM110 - `any` takes twice the time
            if array() is not None:
                return True
        return False

    def lend(self) -> Any:
        """New arrays in the memory, as the space has them."""
        self._lent.clear()
        return map_leaves(self._lend, self._memory)

    def clear(self, rows: np.ndarray) -> None:
        """Set all rows to 0; ``rows`` (int64) will be filled next."""
        for memory in leaves(self._memory):
            memory[self._filled] = 0
        self._filled = rows

    def _lend(self, memory: Memory) -> np.ndarray:
        array = memory.view(np.ndarray)
        self._lent.append(weakref.ref(array))
        return array
