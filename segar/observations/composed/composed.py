"""What observations that are made of others pass on to them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np


class Members:
    """The bound observations that one consists of: their episodes, steps and memories.

    Args:
        members: :class:`segar.observations.protocol.BoundObservation`, each with or without what is optional there.
        names: of their memories, one each.
    """

    def __init__(self, members: Sequence[Any], names: Sequence[str]) -> None:
        self.members = tuple(members)
        self._names = tuple(names)

    def start(self, key: np.ndarray, level: np.ndarray, mask: np.ndarray) -> None:
        """Episodes start where ``mask`` is true."""
        for member in self.members:
            if hasattr(member, "start"):
                member.start(key, level, mask)

    def advance(self, actions: np.ndarray) -> None:
        """All environments have taken a step."""
        for member in self.members:
            if hasattr(member, "advance"):
                member.advance(actions)

    def memory(self) -> dict[str, np.ndarray]:
        """What the members remember, by ``member/name``."""
        return {
            f"{name}/{key}": array
            for name, member in zip(self._names, self.members, strict=True)
            if hasattr(member, "memory")
            for key, array in member.memory().items()
        }

    def recall(self, memory: Mapping[str, np.ndarray]) -> None:
        """Each member gets its part of what :meth:`memory` gave; what is not there, it does not get."""
        for name, member in zip(self._names, self.members, strict=True):
            if hasattr(member, "recall"):
                own = {key.removeprefix(f"{name}/"): a for key, a in memory.items() if key.startswith(f"{name}/")}
                member.recall(own)
