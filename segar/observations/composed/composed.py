"""What observations that are made of others pass on to them, and what a snapshot holds for an observation."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import Any, ClassVar, Self

import numpy as np

from segar.errors import SegarError
from segar.language import Factor, Task
from segar.levels import Levels
from segar.observations.protocol import BoundObservation, Observation, adapted, hooks_of, leaves, map_leaves


class Composed:
    """An observation that is made of others: a dataclass whose field ``MADE_OF`` holds one, or a tuple or dict of them."""

    MADE_OF: ClassVar[str]

    @property
    def members(self) -> tuple[Observation, ...]:
        """The observations that it is made of, in order."""
        return tuple(leaves(getattr(self, self.MADE_OF)))

    def of_changed(self, change: Callable[[Observation], Observation]) -> Self:
        """The same of other members."""
        changed: Any = {self.MADE_OF: map_leaves(change, getattr(self, self.MADE_OF))}
        return replace(self, **changed)  # type: ignore[type-var]

    def shows(self, factor: type[Factor]) -> bool:
        """Whether any of the members shows the factor."""
        return any(member.shows(factor) for member in self.members)

    def for_task(self, task: Task) -> Self:
        """Each of the members in environments of this task."""
        return self.of_changed(lambda member: adapted(member, "for_task", task))

    def trained_on(self, levels: Levels) -> Self:
        """Each of the members of an agent that is trained on these levels."""
        return self.of_changed(lambda member: adapted(member, "trained_on", levels))


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

    def begin(self, values: np.ndarray, level: np.ndarray, mask: np.ndarray) -> None:
        """Prepare each of the members."""
        for member in self.members:
            member.begin(values, level, mask)

    def advance(self, actions: np.ndarray) -> None:
        """Tell all members that the environments took a step."""
        for hooks in self._hooks.values():
            hooks.advance(actions)

    def rewarded(self, reward: np.ndarray) -> None:
        """Tell all members the rewards of the step."""
        for hooks in self._hooks.values():
            hooks.rewarded(reward)

    def forget(self, mask: np.ndarray) -> None:
        """Let all members forget where ``mask`` is true."""
        for hooks in self._hooks.values():
            hooks.forget(mask)

    def memory(self) -> dict[str, np.ndarray]:
        """What the members remember, by ``member/name``."""
        return {f"{name}/{key}": array for name, hooks in self._hooks.items() for key, array in hooks.memory().items()}

    def recall(self, memory: Mapping[str, np.ndarray]) -> None:
        """Give each member its part of what :meth:`memory` returned; what is absent there, the member does not get."""
        for name, hooks in self._hooks.items():
            hooks.recall({key.removeprefix(f"{name}/"): a for key, a in memory.items() if key.startswith(f"{name}/")})


def recall_array(memory: Mapping[str, np.ndarray], name: str, into: np.ndarray) -> bool:
    """Fill an array with the one of this name; return false where the environment of the snapshot did not remember it.

    Raises:
        SegarError: the array has not the shape and dtype of ``into``, because another observation remembered it.
    """
    if name not in memory:
        return False
    found = memory[name]
    if found.shape != into.shape or found.dtype != into.dtype:
        raise SegarError(
            f"this snapshot was taken under another observation: its '{name}' is {found.dtype} {found.shape[1:]} per"
            f" environment, and here it is {into.dtype} {into.shape[1:]}; make the environment with that observation, or"
            " drop what it remembers: replace(snapshot, memory={})"
        )
    into[:] = found
    return True
