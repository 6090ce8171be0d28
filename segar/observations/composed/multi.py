"""Several observations at once: tuples and dicts of any; vectors as one; one of a family, chosen per episode or per level; and
what stands for an observation: a name, a tuple, a dict."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, Literal, cast

import gymnasium
import numpy as np
from gymnasium import spaces

from segar.engine import Call
from segar.errors import SegarError, did_you_mean, must_be
from segar.levels import Levels
from segar.observations import protocol
from segar.observations.composed.composed import BoundComposed, Composed
from segar.observations.protocol import Arrays, BoundObservation, Observation, ObservationLike, map_leaves
from segar.support import LevelGenerator, stream_key

OBSERVATIONS: dict[str, Callable[..., Observation]] = {}
"""Name to what makes the observation from its options. Importing :mod:`segar.observations` adds those that come with SEGAR."""


def make_observation(observation: ObservationLike) -> Observation:
    """An observation from its name, from a tuple, list or dict of observations, or the observation itself.

    Raises:
        SegarError: no observation is called so, or it is none.
    """
    if isinstance(observation, str):
        if observation not in OBSERVATIONS:
            raise SegarError(f"no observation is called '{observation}'.{did_you_mean(observation, OBSERVATIONS)}")
        return OBSERVATIONS[observation]()
    if isinstance(observation, (tuple, list, Mapping)):
        return Multi(observation)
    if isinstance(observation, type) or not hasattr(observation, "bind"):
        names = ", ".join(f"'{name}'" for name in OBSERVATIONS)
        raise SegarError(f"observation must be {names}, a tuple or dict, or an object with bind(), not {observation!r}")
    return cast("Observation", observation)


def trained_on(observation: ObservationLike, levels: Levels) -> Observation:
    """The observation of an agent that is trained on these levels, for environments on any levels.

    Test levels of another distribution are then shown in the units of training, as a trained agent needs them: see
    ``normalise`` of :class:`segar.observations.StateVector`. Observations that do not depend on training stay as they are.

    Raises:
        SegarError: no observation is called so, or it is none.
    """
    return protocol.adapted(make_observation(observation), "trained_on", levels)


@dataclass(frozen=True)
class Multi(Composed):
    """A tuple of observations, or a dict of them by name; its space is Gymnasium's ``Tuple`` or ``Dict``.

    >>> from segar.observations import AllTiles, Multi
    >>> seen = Multi({"frame": "rgb", "tiles": AllTiles()})
    >>> env = segar.envs.VectorEnv(segar.family("empty-hard").sample(2, seed=0), 1, observation=seen)
    >>> sorted(env.single_observation_space)
    ['frame', 'tiles']

    Args:
        parts: a sequence or a mapping of observations, of their names, or of sequences and mappings of these.

    Raises:
        SegarError: there is none, or one is no observation.
    """

    MADE_OF = "parts"
    parts: Sequence[Any] | Mapping[str, Any]

    def __post_init__(self) -> None:
        if not self.parts:
            raise SegarError("Multi: an observation of several parts needs at least one")
        if isinstance(self.parts, Mapping):
            made: Any = {str(name): make_observation(part) for name, part in self.parts.items()}
        else:
            made = tuple(make_observation(part) for part in self.parts)
        object.__setattr__(self, "parts", made)

    def bind(self, levels: Levels, num_envs: int) -> BoundMulti:
        """The observations at work."""
        return BoundMulti(map_leaves(lambda member: member.bind(levels, num_envs), self.parts), num_envs)


class BoundMulti(BoundComposed):
    """:class:`Multi` in one batch of environments.

    Args:
        members: a tuple where the space is a Tuple, or a dict by name where it is a Dict.
    """

    def __init__(self, members: tuple[BoundObservation, ...] | dict[str, BoundObservation], num_envs: int) -> None:
        self._by_key: dict[Any, Any] = members if isinstance(members, dict) else dict(enumerate(members))
        super().__init__([*self._by_key.values()], [str(key) for key in self._by_key])
        own = map_leaves(lambda member: member.space, members)
        self.space: spaces.Space = spaces.Dict(own) if isinstance(members, dict) else spaces.Tuple(own)
        self._order = list(self.space if isinstance(self.space, spaces.Dict) else self._by_key)  # Gymnasium sorts names
        lacking = [key for key, member in self._by_key.items() if protocol.own_arrays(member) is None]
        some_own = len(lacking) < len(members)
        self._others = {key: protocol.empty_batch(self._by_key[key].space, num_envs) for key in lacking if some_own}

    @property
    def kept(self) -> Arrays | None:
        """Of each member, its own arrays, or arrays for it; None where no member owns any."""
        parts = {key: self._others.get(key, protocol.own_arrays(self._by_key[key])) for key in self._order}
        if all(part is None for part in parts.values()):
            return None
        return tuple(parts.values()) if isinstance(self.space, spaces.Tuple) else parts

    def write(self, values: np.ndarray, level: np.ndarray, out: Any, rows: np.ndarray) -> None:
        """Fill ``out[...][rows]`` of each of the members."""
        for key, member in self._by_key.items():
            member.write(values, level, out[key], rows)

    def calls(self, when: str, in_rows: bool = False) -> list[Call]:
        """The calls of all members, each of which knows its part; see :class:`segar.observations.protocol.RunsOnTargets`."""
        return [
            replace(call, part=(key, *call.part))
            for key, member in self._by_key.items()
            for call in protocol.calls_of(member, when, in_rows)
        ]


@dataclass(frozen=True)
class Joined(Composed):
    """Several vectors, one after the other: float32 ``[sum of their sizes]``.

    >>> import segar
    >>> seen = segar.observations.Joined(["state", segar.observations.PreviousStep()])

    Args:
        parts: the observations, or their names; each is a vector of float32.

    Raises:
        SegarError: there is none, or one is no observation.
    """

    MADE_OF = "parts"
    parts: Sequence[Any]

    def __post_init__(self) -> None:
        if isinstance(self.parts, str) or not self.parts:
            raise SegarError(f"Joined: parts must be a list of observations, at least one, not {self.parts!r}")
        object.__setattr__(self, "parts", tuple(make_observation(part) for part in self.parts))

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


PER = ("episode", "level")


@dataclass(frozen=True)
class OneOf(Composed):
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

    MADE_OF = "family"
    family: Sequence[Any]
    per: Literal["episode", "level"] = "episode"
    weights: Sequence[float] | None = None
    seed: int = 0

    def __post_init__(self) -> None:
        object.__setattr__(self, "family", tuple(make_observation(member) for member in self.family))
        if not self.family:
            raise SegarError("OneOf: a family needs at least one observation")
        if self.per not in PER:
            raise SegarError(f"OneOf: per {must_be(self.per, PER)}")
        weights = self._weights()
        sane = np.isfinite(weights).all() and (weights >= 0).all() and weights.sum() > 0
        if weights.shape != (len(self.family),) or not sane:
            raise SegarError(
                f"OneOf: weights must be {len(self.family)} numbers, one for each observation, none negative and not all"
                f" zero; not {self.weights!r}"
            )

    @property
    def probabilities(self) -> np.ndarray:
        """Of each observation, that it is drawn."""
        weights = self._weights()
        return weights / weights.sum()

    def _weights(self) -> np.ndarray:
        """The weights, float64 ``[member]``."""
        return np.ones(len(self.family)) if self.weights is None else np.asarray(self.weights, float)

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
        self.draws_per_episode = one_of.per == "episode" or any(map(protocol.draws_per_episode, members))
        self._probabilities, self._seed = one_of.probabilities, one_of.seed
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
        return LevelGenerator(stream, counter).choice(len(self.members), p=self._probabilities)
