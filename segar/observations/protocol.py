"""What an environment asks of an observation: bind it to levels once, then fill the caller's batch buffer.

An observation is a description (which factors, which resolution); :meth:`Observation.bind` makes the object that
holds caches for one environment. Everything an observation reads is the batch of states, never Python objects.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Protocol, runtime_checkable

if TYPE_CHECKING:
    import gymnasium
    import numpy as np

    from segar.levels import Levels


@runtime_checkable
class BoundObservation(Protocol):
    """An observation at work in one environment; ``space`` is that of a single environment, without the batch axis."""

    space: gymnasium.spaces.Box

    def begin(self, values: np.ndarray, level: np.ndarray, mask: np.ndarray) -> None:
        """Prepare the environments where ``mask`` (bool ``[env]``) is true: their episodes start with these states.

        Args:
            values: states, float64 ``[env, entity, column]``.
            level: index of each environment's level, int64 ``[env]``.
        """
        ...

    def write(self, values: np.ndarray, level: np.ndarray, out: np.ndarray, rows: np.ndarray) -> None:
        """Fill ``out[rows]`` (``[env, *space.shape]``, C-contiguous; rows int64); disjoint rows may run in threads."""
        ...


@runtime_checkable
class Observation(Protocol):
    """A description of what an agent sees."""

    def bind(self, levels: Levels, num_envs: int) -> BoundObservation:
        """Allocate what ``num_envs`` environments on ``levels`` need; nothing is drawn or compiled yet."""
        ...
