"""What an environment asks of an observation: bind it to levels once, then fill the caller's batch buffer.

An observation is a description (which factors, which resolution); :meth:`Observation.bind` makes the object that
holds caches for one environment. Everything an observation reads is the batch of states, never Python objects.

Most observations show the present state and need :class:`Observation` and :class:`BoundObservation` alone. What may
be added is optional, and an environment calls it only where it is there: :meth:`Starts.start` for what is chosen once
per episode, :class:`Remembers` for what shows the past, :class:`Keeps` for what has its observations at hand anyhow,
:class:`DrawsPlanes` for frames, :class:`KnowsTask` for what depends on the task, and ``members``, a tuple of the
observations that one is made of.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Protocol, runtime_checkable

if TYPE_CHECKING:
    from collections.abc import Mapping

    import gymnasium
    import numpy as np

    from segar.language import Factor, Task
    from segar.levels import Levels


@runtime_checkable
class BoundObservation(Protocol):
    """An observation at work in one environment; ``space`` is that of a single environment, without the batch axis."""

    space: gymnasium.Space

    def begin(self, values: np.ndarray, level: np.ndarray, mask: np.ndarray) -> None:
        """Prepare the environments where ``mask`` (bool ``[env]``) is true: their states are not those that a step led
        to, because an episode starts, a snapshot was restored, or somebody intervened.

        Args:
            values: states, float64 ``[env, entity, column]``.
            level: index of each environment's level, int64 ``[env]``.
        """
        ...

    def write(self, values: np.ndarray, level: np.ndarray, out: Any, rows: np.ndarray) -> None:
        """Fill ``out[rows]`` (``[env, *space.shape]``, C-contiguous; rows int64); disjoint rows may run in threads.

        ``out`` is a tuple or dict of such arrays where ``space`` is a Tuple or Dict. Writing again what was written
        changes nothing.
        """
        ...


@runtime_checkable
class Starts(Protocol):
    """A bound observation that chooses something once per episode."""

    def start(self, key: np.ndarray, level: np.ndarray, mask: np.ndarray) -> None:
        """Episodes run under these keys where ``mask`` is true; called before :meth:`BoundObservation.begin`.

        All that is chosen must follow from the key or from the level, so that an environment sees the same whatever the
        batch is, and a restored episode goes on as it was: ``restore`` calls this, too.

        Args:
            key: uint64 ``[env]``, random bits that belong to the episode; its forks share them.
            level: index of each environment's level, int64 ``[env]``.
        """
        ...


@runtime_checkable
class Remembers(Starts, Protocol):
    """A bound observation that shows the past of the episode, and forgets it when one starts."""

    def advance(self, actions: np.ndarray) -> None:
        """All environments have taken a step by these actions, float32 ``[env, action size]``; a write follows."""
        ...

    def memory(self) -> dict[str, np.ndarray]:
        """Copies of what snapshots must hold, by name; arrays lead with the environment."""
        ...

    def recall(self, memory: Mapping[str, np.ndarray]) -> None:
        """Remember what :meth:`memory` gave; called after :meth:`start`, before ``begin``."""
        ...


@runtime_checkable
class Keeps(Protocol):
    """A bound observation that keeps its observations up to date in arrays of its own."""

    kept: Any
    """Arrays ``[env, *space.shape]``, contiguous or not, for environments that may overwrite what they returned: if they
    are the ``out`` of ``write``, there is nothing to copy. None where there are none. After :meth:`Remembers.advance` they
    may be others."""


@runtime_checkable
class Observation(Protocol):
    """A description of what an agent sees."""

    def bind(self, levels: Levels, num_envs: int) -> BoundObservation:
        """Allocate what ``num_envs`` environments on ``levels`` need; nothing is drawn or compiled yet."""
        ...

    def shows(self, factor: type[Factor]) -> bool:
        """Whether the observation changes with the values of this factor, of whatever it shows that has it.

        Where this is false, two states that differ in the factor alone look the same to the bit.
        """
        ...


@runtime_checkable
class DrawsPlanes(Protocol):
    """An observation of frames that a stack need not copy."""

    channels: str
    """Which axis of a frame is that of the channels, the "first" or the "last"."""

    def in_planes(self) -> Observation:
        """The same frames with their channels first; bound, it writes into any ``out`` whose ``out[env]`` is contiguous."""
        ...


@runtime_checkable
class KnowsTask(Protocol):
    """An observation that depends on the task."""

    def for_task(self, task: Task) -> Observation:
        """The observation in environments of this task."""
        ...
