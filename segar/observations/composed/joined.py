"""Several vectors as one observation, for policies that read one array."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import gymnasium
import numpy as np

from segar.errors import SegarError
from segar.language import Factor, Task
from segar.levels import Levels
from segar.observations.composed.composed import BoundComposed
from segar.observations.composed.multi import make_observation, trained_on
from segar.observations.protocol import BoundObservation, Observation, for_task


@dataclass(frozen=True)
class Joined:
    """Several vectors, one after the other: float32 ``[sum of their sizes]``.

    >>> import segar
    >>> seen = segar.observations.Joined(["state", segar.observations.PreviousStep()])

    Args:
        parts: the observations, or their names; each is a vector of float32.

    Raises:
        SegarError: there is none, or one is no observation.
    """

    parts: Sequence[Any]

    def __post_init__(self) -> None:
        if isinstance(self.parts, str) or not self.parts:
            raise SegarError(f"Joined: parts must be a list of observations, at least one, not {self.parts!r}")
        object.__setattr__(self, "parts", tuple(make_observation(part) for part in self.parts))

    @property
    def members(self) -> tuple[Observation, ...]:
        """The observations, in order."""
        return tuple(self.parts)

    def shows(self, factor: type[Factor]) -> bool:
        """Whether any of the members shows the factor."""
        return any(member.shows(factor) for member in self.parts)

    def for_task(self, task: Task) -> Joined:
        """Each of the members in environments of this task."""
        return replace(self, parts=[for_task(part, task) for part in self.parts])

    def trained_on(self, levels: Levels) -> Joined:
        """Each of the members of an agent that is trained on these levels."""
        return replace(self, parts=[trained_on(part, levels) for part in self.parts])

    def bind(self, levels: Levels, num_envs: int) -> BoundJoined:
        """The observation at work; raises :class:`SegarError` if a part is no vector of float32."""
        return BoundJoined([member.bind(levels, num_envs) for member in self.parts], num_envs)


class BoundJoined(BoundComposed):
    """:class:`Joined` in one batch of environments.

    Attributes:
        names: what each number is, as the members say; the number of the member and the place in it where one does not.
    """

    def __init__(self, members: list[BoundObservation], num_envs: int) -> None:
        super().__init__(members, [str(k) for k in range(len(members))])
        for k, member in enumerate(members):
            box = member.space
            if not isinstance(box, gymnasium.spaces.Box) or len(box.shape) != 1 or box.dtype != np.float32:
                raise SegarError(
                    f"Joined: it joins vectors of float32, and its part number {k} is {box}; give frames, tables, tuples and"
                    " dicts beside it, as in {'pixels': 'rgb', 'past': PreviousStep()}"
                )
        boxes: list[Any] = [member.space for member in members]
        low, high = np.concatenate([box.low for box in boxes]), np.concatenate([box.high for box in boxes])
        self.space = gymnasium.spaces.Box(low, high, dtype=np.float32)
        sizes = [box.shape[0] for box in boxes]
        self.names = [
            name
            for k, (member, size) in enumerate(zip(members, sizes, strict=True))
            for name in getattr(member, "names", [f"{k}.{place}" for place in range(size)])
        ]
        ends = np.cumsum(sizes).tolist()
        self._places = [slice(end - size, end) for end, size in zip(ends, sizes, strict=True)]
        self._parts = [np.zeros((num_envs, size), np.float32) for size in sizes]

    def write(self, values: np.ndarray, level: np.ndarray, out: np.ndarray, rows: np.ndarray) -> None:
        """Fill ``out[rows]``."""
        for member, place, part in zip(self.members, self._places, self._parts, strict=True):
            member.write(values, level, part, rows)
            out[rows, place] = part[rows]
