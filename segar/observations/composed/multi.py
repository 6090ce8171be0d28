"""Several observations at once: tuples and dicts of any; and what stands for an observation: a name, a tuple, a dict."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, cast

import numpy as np
from gymnasium import spaces

from segar.errors import SegarError
from segar.observations.arrays import empty_batch
from segar.observations.composed.composed import BoundComposed
from segar.observations.hooks import for_task, own_arrays
from segar.observations.protocol import Arrays, BoundObservation, Observation, ObservationLike
from segar.observations.registry import OBSERVATIONS, observation_named

if TYPE_CHECKING:
    from segar.language import Factor, Task
    from segar.levels import Levels


def make_observation(observation: ObservationLike) -> Observation:
    """An observation from its name, from a tuple, list or dict of observations, or the observation itself.

    Raises:
        SegarError: no observation is called so, or it is none.
    """
    if isinstance(observation, str):
        return observation_named(observation)
    if isinstance(observation, (tuple, list, Mapping)):
        return Multi(observation)
    if not hasattr(observation, "bind"):
        names = ", ".join(f"'{name}'" for name in OBSERVATIONS)
        raise SegarError(f"observation must be {names}, a tuple or dict, or an object with bind(), not {observation!r}")
    return cast("Observation", observation)


@dataclass(frozen=True)
class Multi:
    """A tuple of observations, or a dict of them by name; its space is Gymnasium's ``Tuple`` or ``Dict``.

    Args:
        parts: a sequence or a mapping of observations, of their names, or of sequences and mappings of these.

    Raises:
        SegarError: there is none, or one is no observation.
    """

    parts: Sequence[Any] | Mapping[str, Any]

    def __post_init__(self) -> None:
        if not self.parts:
            raise SegarError("Multi: an observation of several parts needs at least one")
        if isinstance(self.parts, Mapping):
            made: Any = {str(name): make_observation(part) for name, part in self.parts.items()}
        else:
            made = tuple(make_observation(part) for part in self.parts)
        object.__setattr__(self, "parts", made)

    @property
    def members(self) -> tuple[Observation, ...]:
        """The observations, in order."""
        return tuple(self.parts.values()) if isinstance(self.parts, Mapping) else tuple(self.parts)

    def shows(self, factor: type[Factor]) -> bool:
        """Whether any of the members shows the factor."""
        return any(member.shows(factor) for member in self.members)

    def for_task(self, task: Task) -> Multi:
        """Each of the members in environments of this task."""
        if isinstance(self.parts, Mapping):
            return Multi({name: for_task(part, task) for name, part in self.parts.items()})
        return Multi([for_task(part, task) for part in self.parts])

    def bind(self, levels: Levels, num_envs: int) -> BoundMulti:
        """The observations at work."""
        names = list(self.parts) if isinstance(self.parts, Mapping) else None
        return BoundMulti([member.bind(levels, num_envs) for member in self.members], names, num_envs)


class BoundMulti(BoundComposed):
    """:class:`Multi` in one batch of environments; see :class:`segar.observations.protocol.OwnsBuffers`.

    Args:
        names: of the members where the space is a Dict, None where it is a Tuple.
    """

    def __init__(self, members: list[BoundObservation], names: list[str] | None, num_envs: int) -> None:
        keys: list[Any] = list(names or range(len(members)))
        super().__init__(members, [str(key) for key in keys])
        self._by_key = dict(zip(keys, members, strict=True))
        own = [member.space for member in members]
        self.space: spaces.Space = (
            spaces.Tuple(own) if names is None else spaces.Dict(dict(zip(names, own, strict=True)))
        )
        self._order = keys if names is None else list(self.space)  # Gymnasium sorts the names of a Dict
        owns = {key: own_arrays(member) is not None for key, member in self._by_key.items()}
        self._others = {
            key: empty_batch(member.space, num_envs)
            for key, member in self._by_key.items()
            if any(owns.values()) and not owns[key]
        }

    @property
    def kept(self) -> Arrays | None:
        """Of each member, its own arrays, or arrays for it; None where no member owns any."""
        parts = {key: self._others.get(key, own_arrays(self._by_key[key])) for key in self._order}
        if all(part is None for part in parts.values()):
            return None
        return tuple(parts.values()) if isinstance(self.space, spaces.Tuple) else parts

    def begin(self, values: np.ndarray, level: np.ndarray, mask: np.ndarray) -> None:
        """Prepare each of the members."""
        for member in self.members:
            member.begin(values, level, mask)

    def write(self, values: np.ndarray, level: np.ndarray, out: Any, rows: np.ndarray) -> None:
        """Fill ``out[...][rows]`` of each of the members."""
        for key, member in self._by_key.items():
            member.write(values, level, out[key], rows)
