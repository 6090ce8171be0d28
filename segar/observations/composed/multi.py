"""Several observations at once: tuples and dicts of any."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from gymnasium import spaces

from segar.errors import SegarError
from segar.observations.arrays import empty_batch
from segar.observations.composed.composed import Members

if TYPE_CHECKING:
    from segar.language import Factor, Task
    from segar.levels import Levels


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
        from segar.observations.registry import make_observation

        if not self.parts:
            raise SegarError("Multi: an observation of several parts needs at least one")
        if isinstance(self.parts, Mapping):
            made: Any = {str(name): make_observation(part) for name, part in self.parts.items()}
        else:
            made = tuple(make_observation(part) for part in self.parts)
        object.__setattr__(self, "parts", made)

    @property
    def members(self) -> tuple[Any, ...]:
        """The observations, in order."""
        return tuple(self.parts.values()) if isinstance(self.parts, Mapping) else tuple(self.parts)

    def shows(self, factor: type[Factor]) -> bool:
        """Whether any of them does."""
        return any(member.shows(factor) for member in self.members)

    def for_task(self, task: Task) -> Multi:
        """Each of them in environments of this task."""
        from segar.observations.registry import for_task

        if isinstance(self.parts, Mapping):
            return Multi({name: for_task(part, task) for name, part in self.parts.items()})
        return Multi([for_task(part, task) for part in self.parts])

    def bind(self, levels: Levels, num_envs: int) -> BoundMulti:
        """The observations at work."""
        names = list(self.parts) if isinstance(self.parts, Mapping) else None
        return BoundMulti([member.bind(levels, num_envs) for member in self.members], names, num_envs)


class BoundMulti(Members):
    """:class:`Multi` in one environment."""

    def __init__(self, members: list[Any], names: list[str] | None, num_envs: int) -> None:
        super().__init__(members, names or [str(k) for k in range(len(members))])
        self._keys: list[Any] = list(names or range(len(members)))
        own = [member.space for member in members]
        self.space: spaces.Space = (
            spaces.Tuple(own) if names is None else spaces.Dict(dict(zip(names, own, strict=True)))
        )
        kept = [getattr(member, "kept", None) is not None for member in members]
        self._others = [
            empty_batch(member.space, num_envs) if any(kept) and not its_own else None
            for member, its_own in zip(members, kept, strict=True)
        ]

    @property
    def kept(self) -> Any:
        """Of each member, what it keeps, or arrays for it; None where no member keeps anything."""
        parts = [
            member.kept if other is None and hasattr(member, "kept") else other
            for member, other in zip(self.members, self._others, strict=True)
        ]
        if all(part is None for part in parts):
            return None
        return tuple(parts) if isinstance(self.space, spaces.Tuple) else dict(zip(self._keys, parts, strict=True))

    def begin(self, values: np.ndarray, level: np.ndarray, mask: np.ndarray) -> None:
        """Prepare each of them."""
        for member in self.members:
            member.begin(values, level, mask)

    def write(self, values: np.ndarray, level: np.ndarray, out: Any, rows: np.ndarray) -> None:
        """Fill ``out[...][rows]`` of each of them."""
        for key, member in zip(self._keys, self.members, strict=True):
            member.write(values, level, out[key], rows)
