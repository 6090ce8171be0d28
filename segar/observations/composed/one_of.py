"""A stochastic observation: one of a family, chosen per episode or per level."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, Literal

import gymnasium
import numpy as np

from segar.errors import SegarError, did_you_mean
from segar.observations.composed.composed import BoundComposed
from segar.observations.composed.multi import make_observation
from segar.observations.hooks import for_task
from segar.observations.protocol import Observation
from segar.support import LOW_WORD, SPACING, SPARE_BITS, WORD, philox, stream_key

if TYPE_CHECKING:
    from segar.language import Factor, Task
    from segar.levels import Levels

PER = ("episode", "level")


@dataclass(frozen=True)
class OneOf:
    """One of several observations of equal spaces, drawn for each episode or for each level.

    Per episode, the draw belongs to the episode: it depends on the environments' seed, the environment and the number
    of its episode, and forks share it. Per level, it belongs to the level: to the distribution, seed, split and index
    that it comes from, so that a level looks the same in every set and every environment. Neither depends on the number
    of environments or of threads.

    Args:
        family: the observations, or their names.
        per: "episode" or "level".
        weights: how probable each is, in proportion; None for equally.
        seed: another one draws otherwise.

    Raises:
        SegarError: an option is unknown or out of range.
    """

    family: Sequence[Any]
    per: Literal["episode", "level"] = "episode"
    weights: Sequence[float] | None = None
    seed: int = 0

    def __post_init__(self) -> None:
        object.__setattr__(self, "family", tuple(make_observation(member) for member in self.family))
        if not self.family:
            raise SegarError("OneOf: a family needs at least one observation")
        if self.per not in PER:
            raise SegarError(
                f"OneOf: per must be 'episode' or 'level', not {self.per!r}.{did_you_mean(str(self.per), PER)}"
            )
        weights = self._weights()
        sane = np.isfinite(weights).all() and (weights >= 0).all() and weights.sum() > 0
        if weights.shape != (len(self.family),) or not sane:
            raise SegarError(
                f"OneOf: weights must be {len(self.family)} numbers, one for each observation, none negative and not all"
                f" zero; not {self.weights!r}"
            )

    @property
    def members(self) -> tuple[Observation, ...]:
        """The observations, in order."""
        return tuple(self.family)

    @property
    def edges(self) -> np.ndarray:
        """Where on [0, 1) the range of each observation ends."""
        weights = self._weights()
        return np.cumsum(weights / weights.sum())

    def _weights(self) -> np.ndarray:
        """The weights, float64 ``[member]``."""
        return np.ones(len(self.family)) if self.weights is None else np.asarray(self.weights, float)

    def shows(self, factor: type[Factor]) -> bool:
        """Whether any of the members shows the factor."""
        return any(member.shows(factor) for member in self.family)

    def for_task(self, task: Task) -> OneOf:
        """Each of the members in environments of this task."""
        return replace(self, family=[for_task(member, task) for member in self.family])

    def bind(self, levels: Levels, num_envs: int) -> BoundOneOf:
        """The observations at work; raises :class:`SegarError` if their spaces differ."""
        return BoundOneOf(self, levels, num_envs)


class BoundOneOf(BoundComposed):
    """:class:`OneOf` in one batch of environments; ``chosen`` (int64 ``[env]``) says which member each environment shows."""

    def __init__(self, one_of: OneOf, levels: Levels, num_envs: int) -> None:
        members = [member.bind(levels, num_envs) for member in one_of.family]
        super().__init__(members, [str(k) for k in range(len(members))])
        self.space: gymnasium.Space = members[0].space
        for k, member in enumerate(members):
            if member.space != self.space:
                raise SegarError(
                    f"OneOf: the spaces of its observations must be equal; the first one's is {self.space}, and number"
                    f" {k}'s is {member.space}"
                )
        self._edges, self._seed = one_of.edges[:-1], one_of.seed
        self._of_level = None
        if one_of.per == "level":
            origin = levels.provenance
            self._of_level = self._draw(
                stream_key("observation", "level", one_of.seed, origin.distribution, origin.seed, origin.split),
                origin.indices,
            )
        self.chosen = np.zeros(num_envs, np.int64)

    def start(self, key: np.ndarray, level: np.ndarray, mask: np.ndarray) -> None:
        """Choose for the episodes where ``mask`` is true; each member starts those that it shows."""
        if self._of_level is not None:
            self.chosen[mask] = self._of_level[level[mask]]
        else:
            self.chosen[mask] = self._draw(stream_key("observation", "episode", self._seed), key[mask])
        for k, hooks in enumerate(self._hooks.values()):
            hooks.start(key, level, mask & (self.chosen == k))

    def begin(self, values: np.ndarray, level: np.ndarray, mask: np.ndarray) -> None:
        """Prepare the members that the environments show."""
        for k, member in enumerate(self.members):
            member.begin(values, level, mask & (self.chosen == k))

    def write(self, values: np.ndarray, level: np.ndarray, out: Any, rows: np.ndarray) -> None:
        """Fill ``out[rows]``, each row by the member that its environment shows."""
        chosen = self.chosen[rows]
        for k, member in enumerate(self.members):
            own = rows[chosen == k]
            if len(own):
                member.write(values, level, out, own)

    def _draw(self, stream: int, counter: np.ndarray) -> np.ndarray:
        """Which member each counter draws, int64."""
        counter = np.asarray(counter).astype(np.uint64)
        zero = np.zeros_like(counter)
        high, low, _, _ = philox((counter & LOW_WORD, counter >> WORD, zero, zero), stream)
        uniform = (((high << WORD) | low) >> SPARE_BITS) * SPACING
        return np.searchsorted(self._edges, uniform, side="right")
