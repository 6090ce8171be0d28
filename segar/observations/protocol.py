"""What an environment asks of an observation, and when it calls what.

An observation is a description: which factors, which resolution. :meth:`Observation.bind` makes the object that works in one
batch of environments and holds its caches. It reads arrays of states and never Python objects.

An environment calls a bound observation in this order; those in brackets are :class:`Hooks`, which are called only where the
bound observation has them:

* episodes start: [``forget``, of those that are the first on their level], [``start``], then ``begin``, then ``write``;
* a step was taken: [``advance``], [``rewarded``], then ``write``;
* a step is taken, and the observation has :func:`simulator_reads`: the simulator writes it, and ``write`` is not called;
* the caller intervened in the states: ``begin``, then ``write``;
* a snapshot is taken: [``memory``];
* a snapshot is restored: [``forget``], [``start``], [``recall``], then ``begin``, then ``write``.

``write`` fills arrays of the environment, or those of the observation itself where it has :func:`own_arrays`.

The optional parts are looked up by ``getattr``, because ``isinstance`` of a protocol does not see attributes that a wrapper
forwards by ``__getattr__``.
"""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, fields
from typing import Any, Protocol, TypeAlias, runtime_checkable

import gymnasium
import numpy as np
from gymnasium import spaces
from gymnasium.vector.utils import create_empty_array

from segar.engine import Call, Reads
from segar.language import Factor
from segar.levels import Levels

Arrays: TypeAlias = np.ndarray | tuple[Any, ...] | dict[str, Any]
"""An array, or tuples and dicts of arrays, as a Box, Tuple or Dict space has them."""


@runtime_checkable
class BoundObservation(Protocol):
    """An observation at work in one batch of environments."""

    @property
    def space(self) -> gymnasium.Space:
        """The space of the observations of a single environment, without the batch axis; a plain attribute will do."""
        ...

    def begin(self, values: np.ndarray, level: np.ndarray, mask: np.ndarray) -> None:
        """Prepare the environments where ``mask`` (bool ``[env]``) is true, whose states no step led to.

        Their episodes start, or a snapshot was restored, or the caller intervened.

        Args:
            values: states, float64 ``[env, entity, column]``.
            level: index of each environment's level, int64 ``[env]``.
        """

    def write(self, values: np.ndarray, level: np.ndarray, out: Any, rows: np.ndarray) -> None:
        """Fill ``out[rows]`` (``[env, *space.shape]``, C-contiguous; rows int64); threads may write disjoint rows.

        ``out`` is a tuple or dict of such arrays where ``space`` is a Tuple or Dict. To write the same states twice has
        the same result as to write them once.
        """


@runtime_checkable
class Observation(Protocol):
    """A description of what an agent sees."""

    def bind(self, levels: Levels, num_envs: int) -> BoundObservation:
        """Allocate what ``num_envs`` environments on ``levels`` need; nothing is drawn or compiled yet."""
        ...

    def shows(self, factor: type[Factor]) -> bool:
        """Whether the observation may change with the values of this factor, of the entities that it shows.

        Where this is false, two states that differ in this factor alone give equal observations.
        """
        ...


@runtime_checkable
class RunsOnTargets(Protocol):
    """A bound observation that is made by compiled functions alone, so that it can be made on other targets, too."""

    def calls(self, when: str, in_rows: bool = False) -> Sequence[Call]:
        """The calls that do what the method of this name does, one after the other: ``begin`` or ``write``, and ``start`` or
        ``advance`` where the observation has these methods.

        What changes from call to call lies in arrays of the calls that lead with the environment. The caller gives
        ``values`` and ``level``, to ``start`` also ``key``, to ``advance`` also ``actions``, and to ``write`` also the
        observations: ``out`` (``(envs, numbers)``), and ``mask`` like it; or ``frames``, the bytes of all environments.

        Args:
            in_rows: whether calls that draw frames have the rows of frames as things, for targets with thousands of threads.
        """
        ...


ObservationLike: TypeAlias = Observation | str | Sequence[Any] | Mapping[str, Any]
"""An observation, its name in :data:`segar.observations.OBSERVATIONS`, or a sequence or mapping of these."""


@runtime_checkable
class DrawsPlanes(Protocol):
    """An observation of frames that a stack need not copy."""

    channels: str
    """Which axis of a frame is that of the channels, the "first" or the "last"."""

    def in_planes(self) -> Observation:
        """The same frames with their channels first; bound, it writes into any ``out`` whose ``out[env]`` is contiguous."""
        ...


def _do_nothing(*arguments: Any) -> None:
    """Stand in for a hook that an observation does not have."""


@dataclass(frozen=True)
class Hooks:
    """The optional methods of a bound observation, and functions that do nothing in the place of those that it lacks."""

    start: Callable[[np.ndarray, np.ndarray, np.ndarray], None] = _do_nothing
    """``start(key, level, mask)``: start episodes under these keys where ``mask`` (bool ``[env]``) is true.

    ``key``, uint64 ``[env]``, holds random bits that belong to the episode; its forks share them. ``level``, int64 ``[env]``,
    is the index of each environment's level. All that is chosen must follow from the key or from the level. An environment
    then sees the same in a batch of any size, and a restored episode goes on as it was. An observation whose ``start`` makes
    no use of the key says so by an attribute ``draws_per_episode``, which is then false; see :func:`draws_per_episode`.
    """
    advance: Callable[[np.ndarray], None] = _do_nothing
    """``advance(actions)``: all environments took a step by these actions, float32 ``[env, action size]``."""
    rewarded: Callable[[np.ndarray], None] = _do_nothing
    """``rewarded(reward)``: the rewards of the step that all environments took, float64 ``[env]``."""
    forget: Callable[[np.ndarray], None] = _do_nothing
    """``forget(mask)``: forget what was before where ``mask`` (bool ``[env]``) is true: the first episode on a level starts. It
    is for what is remembered over the trials of a level, which are episodes in a row."""
    memory: Callable[[], dict[str, np.ndarray]] = dict
    """``memory()``: copies of what snapshots must hold, by name, where more is shown than the present state; arrays lead with
    the environment."""
    recall: Callable[[Mapping[str, np.ndarray]], None] = _do_nothing
    """``recall(memory)``: remember what ``memory`` returned. An array is absent where another observation took the snapshot."""


def hooks_of(observation: BoundObservation) -> Hooks:
    """The hooks of a bound observation."""
    names = (field.name for field in fields(Hooks))
    return Hooks(**{name: getattr(observation, name) for name in names if hasattr(observation, name)})


def own_arrays(observation: BoundObservation) -> Arrays | None:
    """The arrays ``kept`` of a bound observation that keeps its observations up to date in arrays of its own; None without.

    They are ``[env, *space.shape]``, contiguous or not. An environment that may overwrite what it returned (``copy=False``)
    gives them to ``write`` as ``out`` and returns them, so that nothing is copied. After ``advance`` they may be others.
    """
    return getattr(observation, "kept", None)


def simulator_reads(observation: BoundObservation) -> Reads | None:
    """The numbers ``reads`` of the state that a bound observation shows as they are, None if it is written after the step.

    The simulator writes them during the step, while the states are in the processor's cache. Observations that are composed of
    others are written after the step.
    """
    return getattr(observation, "reads", None)


def calls_of(observation: BoundObservation, when: str, in_rows: bool = False) -> list[Call]:
    """The calls of an observation that :class:`RunsOnTargets`; none where it lacks the method ``when``."""
    return list(observation.calls(when, in_rows)) if hasattr(observation, when) else []  # type: ignore[attr-defined]


def without_calls(observation: BoundObservation) -> BoundObservation | None:
    """The observation, or one of those that it is composed of, that has no compiled form for other targets, if one has not."""
    if not isinstance(observation, RunsOnTargets):
        return observation
    members = getattr(observation, "members", ())
    return next((found for found in map(without_calls, members) if found is not None), None)


def draws_per_episode(observation: BoundObservation) -> bool:
    """Whether two episodes of equal states may be observed differently, because the observation chooses by their keys.

    It is what the observation's attribute of this name says. Without one, an observation that is composed of others draws
    if one of these does, and any other is taken to draw if it has the hook ``start``.
    """
    members = getattr(observation, "members", None)
    otherwise = hasattr(observation, "start") if members is None else any(map(draws_per_episode, members))
    return bool(getattr(observation, "draws_per_episode", otherwise))


def adapted(observation: Observation, method: str, to: Any) -> Observation:
    """What the optional method ``for_task`` or ``trained_on`` of an observation gives; itself where it has none."""
    adapt = getattr(observation, method, None)
    return observation if adapt is None else adapt(to)


def empty_batch(space: spaces.Space, num_envs: int) -> Any:
    """Arrays ``[num_envs, ...]`` for the observations of a batch of environments, not filled."""
    return create_empty_array(space, num_envs, np.empty)


def leaves(tree: Any) -> Iterator[Any]:
    """What is in tuples and dicts of tuples and dicts, such as the arrays of an observation, in their order."""
    if isinstance(tree, (dict, tuple)):
        for part in tree.values() if isinstance(tree, dict) else tree:
            yield from leaves(part)
    else:
        yield tree


def map_leaves(function: Callable[..., Any], tree: Any, *others: Any) -> Any:
    """The same tuples and dicts with ``function`` of each of the :func:`leaves` in its place; of those in equal places where
    there are several trees of one form."""
    if isinstance(tree, dict):
        return {name: map_leaves(function, part, *(other[name] for other in others)) for name, part in tree.items()}
    if isinstance(tree, tuple):
        return tuple(map_leaves(function, *parts) for parts in zip(tree, *others, strict=True))
    return function(tree, *others)
