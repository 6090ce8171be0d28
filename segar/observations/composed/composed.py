"""What bound observations that are made of others pass on to them."""

from collections.abc import Mapping, Sequence

import numpy as np

from segar.observations.hooks import hooks_of
from segar.observations.protocol import BoundObservation


class BoundComposed:
    """The bound observations that one consists of: their episodes, steps and memories.

    Args:
        members: the bound observations.
        names: of their memories, one each.
    """

    def __init__(self, members: Sequence[BoundObservation], names: Sequence[str]) -> None:
        self.members = tuple(members)
        self._hooks = {name: hooks_of(member) for name, member in zip(names, members, strict=True)}

    def start(self, key: np.ndarray, level: np.ndarray, mask: np.ndarray) -> None:
        """Start episodes of all members where ``mask`` is true."""
        for hooks in self._hooks.values():
            hooks.start(key, level, mask)

    def advance(self, actions: np.ndarray) -> None:
        """Tell all members that the environments took a step."""
        for hooks in self._hooks.values():
            hooks.advance(actions)

    def memory(self) -> dict[str, np.ndarray]:
        """What the members remember, by ``member/name``."""
        return {f"{name}/{key}": array for name, hooks in self._hooks.items() for key, array in hooks.memory().items()}

    def recall(self, memory: Mapping[str, np.ndarray]) -> None:
        """Give each member its part of what :meth:`memory` returned; what is absent there, the member does not get."""
        for name, hooks in self._hooks.items():
            hooks.recall({key.removeprefix(f"{name}/"): a for key, a in memory.items() if key.startswith(f"{name}/")})
