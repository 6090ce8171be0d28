"""The levels that environments draw from while they run: some can be replaced, and each can have a weight."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, Self

import numpy as np

from segar.envs.checks import instance, shown
from segar.errors import LevelError
from segar.language import FloorFriction
from segar.levels import LEVEL_ARRAYS, Levels, Provenance, check_levels, with_room
from segar.support import __version__

REPLACED = -1  # what ``info`` says of the level of an episode that goes on although its level was replaced


@dataclass(frozen=True, eq=False)
class LevelPool:
    """What a batch of environments plays.

    Attributes:
        levels: first those that episodes start on; where ``count`` is below their number, row ``count + e`` is the level that
            environment e went on with when its level was replaced.
        count: number of levels that episodes start on.
        weights: float64 ``(count,)``, how often episodes start on each, relative to the others; None: equally often.
        bases: int64, of row ``count + e`` the level that environment e plays with world parameters that the caller set, or
            ``REPLACED``; None: all ``REPLACED``.
    """

    levels: Levels
    count: int
    weights: np.ndarray | None = None
    bases: np.ndarray | None = None

    @property
    def is_plain(self) -> bool:
        """Whether episodes start on every level of the set, equally often."""
        return self.weights is None and self.count == len(self.levels)

    @cached_property
    def drawn(self) -> Levels:
        """The levels that episodes start on."""
        return self.levels if self.count == len(self.levels) else self.levels[: self.count]

    @cached_property
    def cumulative(self) -> np.ndarray:
        """The sums of the weights up to each level, float64 ``(count,)``; empty where all levels are drawn equally often."""
        return np.zeros(0) if self.weights is None else np.cumsum(self.weights)

    def named(self, level: np.ndarray) -> np.ndarray:
        """The levels of episodes as ``info`` says them, int64: an index in :attr:`drawn`, or ``REPLACED``."""
        if self.count == len(self.levels):
            return level.copy()
        others = np.full(len(self.levels) - self.count, REPLACED) if self.bases is None else self.bases
        return np.concatenate([np.arange(self.count), others])[level]

    def parameters_of(self, level: np.ndarray) -> tuple[np.ndarray, np.ndarray | None]:
        """The levels in whose worlds the caller set parameters, by their own places, and these environments' parameters.

        Args:
            level: int64 ``(num_envs,)``, the rows that environments play.

        Returns:
            The rows, and float64 ``(num_envs, parameters)``, nan where none was set; None where none was set anywhere.
        """
        named = self.named(level)
        own = (level >= self.count) & (named != REPLACED)
        if not own.any():
            return level, None
        return np.where(own, named, level), np.where(own[:, None], self.levels.parameters[level], np.nan)

    def with_parameters(self, level: np.ndarray, parameters: np.ndarray) -> tuple[Self, np.ndarray]:
        """The pool in which environments play their levels with these world parameters, and the rows of their levels.

        Args:
            level, parameters: what :meth:`parameters_of` returned.
        """
        own = ~np.isnan(parameters).all(axis=1)
        levels = self.levels[np.concatenate([np.arange(self.count), level])]
        values, given = levels.values.copy(), levels.parameters.copy()
        given[self.count :][own] = parameters[own]
        floor = levels.layout.parameters.index(FloorFriction)
        other = np.flatnonzero(given[:, floor] != levels.parameters[:, floor])
        part = values[other]
        levels.layout.set_floor(part, given[other])
        values[other] = part
        rows = np.where(own | (level >= self.count), self.count + np.arange(len(level)), level)
        bases = np.where(own, level, REPLACED)
        return replace(self, levels=replace(levels, values=values, parameters=given), bases=bases), rows

    def weighted(self, weights: Any) -> Self:
        """The pool with these weights; None, and equal weights, for levels that are drawn uniformly.

        Raises:
            LevelError: there is not one finite weight of at least 0 for each level, or all are 0.
        """
        if weights is None:
            return replace(self, weights=None)
        try:
            array = np.array(weights, dtype=np.float64)
        except (TypeError, ValueError) as error:
            raise LevelError(f"level weights must be {self.count} numbers, not {shown(weights)}") from error
        if array.shape != (self.count,):
            raise LevelError(
                f"level weights must have the shape ({self.count},), one for each level, not {array.shape}"
            )
        wrong = np.flatnonzero(~np.isfinite(array) | (array < 0))
        if len(wrong):
            raise LevelError(
                f"level weights must be finite and at least 0, and that of level {wrong[0]} is {array[wrong[0]]}"
            )
        if not np.isfinite(array.sum()) or not array.sum() > 0:
            raise LevelError("level weights must have a finite sum above 0, so that some level can be drawn")
        return replace(self, weights=None if (array == array[0]).all() else array)

    def replaced(self, indices: Any, levels: Levels, playing: np.ndarray | None) -> tuple[Self, np.ndarray | None]:
        """The pool with other levels at ``indices``, and the rows of the running episodes in it.

        Args:
            indices: int ``(k,)``, each once.
            levels: ``k`` levels with the same layout, rules and task.
            playing: int64 ``(num_envs,)``, the row that each environment plays, or None where none plays.

        Raises:
            LevelError: the indices or the levels do not fit.
        """
        instance("replace_levels: levels", levels, Levels, "segar.Levels, as distribution.sample(10) makes them")
        places = self._places(indices, len(levels))
        self._require_alike(levels)
        check_levels(levels, "replace_levels: ")
        retired = np.zeros(0, np.bool_) if playing is None else (playing >= self.count) | np.isin(playing, places)
        named = None if playing is None else self.named(playing)
        bases = None if named is None else np.where(np.isin(named, places), REPLACED, named)
        rows = np.arange(self.count)
        if playing is not None and retired.any():
            rows = np.concatenate([rows, playing])
            playing = np.where(retired, self.count + np.arange(len(playing)), playing)
        mixed, given = with_room(self.levels, levels)[rows].writable(), with_room(levels, self.levels)
        for name in LEVEL_ARRAYS:
            getattr(mixed, name)[places] = getattr(given, name)
        indices_in_split = mixed.provenance.indices.copy()
        indices_in_split[places] = levels.provenance.indices
        origin = _origin(self.levels.provenance, levels.provenance, indices_in_split)
        return replace(self, levels=Levels(**{**vars(mixed.closed()), "provenance": origin}), bases=bases), playing

    def arrays(self) -> dict[str, np.ndarray]:
        """All that :meth:`with_arrays` needs to make this pool again, as arrays by name."""
        own = {name: getattr(self.levels, name) for name in LEVEL_ARRAYS}
        origin = self.levels.provenance
        has_origin = np.array([bool(origin.distribution)])
        weights = np.zeros(0) if self.weights is None else self.weights
        counts = {"indices": origin.indices, "count": np.array([self.count]), "has_origin": has_origin}
        return own | counts | {"weights": weights}

    def with_arrays(self, arrays: Mapping[str, np.ndarray]) -> Self:
        """The pool that gave ``arrays``; this one is of the levels that the other one began with."""
        origin = replace(self.levels.provenance, indices=arrays["indices"])
        if origin.distribution and not arrays["has_origin"][0]:
            origin = _mixed(origin, arrays["indices"])
        own = {name: arrays[name] for name in LEVEL_ARRAYS}
        weights = arrays["weights"] if len(arrays["weights"]) else None
        return replace(
            self, levels=replace(self.levels, **own, provenance=origin), count=int(arrays["count"][0]), weights=weights
        )

    def _places(self, indices: Any, number: int) -> np.ndarray:
        """The indices as int64; raises :class:`LevelError`."""
        places = np.asarray(indices)
        if places.ndim != 1 or places.dtype.kind not in "iu" or len(places) != number:
            raise LevelError(
                f"replace_levels: indices must be {number} whole numbers, one for each of the given levels, not"
                f" {shown(indices)}"
            )
        wrong = places[(places < 0) | (places >= self.count)]
        if len(wrong):
            raise LevelError(f"replace_levels: indices must lie in 0..{self.count - 1}, and one is {wrong[0]}")
        if len(np.unique(places)) < len(places):
            raise LevelError("replace_levels: an index is named twice; name each level once")
        return places.astype(np.int64)

    def _require_alike(self, levels: Levels) -> None:
        """Raise :class:`LevelError` unless the levels can take the place of others without another kernel."""
        if levels.layout != self.levels.layout:
            raise LevelError(
                f"replace_levels: the given levels have entities {', '.join(levels.layout.names)}, and these environments"
                f" {', '.join(self.levels.layout.names)}, or they hold other factors or parameters; take levels of one"
                " distribution, or make other environments"
            )
        if levels.world != self.levels.world or levels.provenance.rules != self.levels.provenance.rules:
            raise LevelError(
                "replace_levels: the given levels have other rules than those of these environments; make other environments"
            )
        if levels.task != self.levels.task:
            raise LevelError(
                f"replace_levels: the given levels are for the task {levels.task}, and those of these environments for"
                f" {self.levels.task}; make other environments"
            )


def _origin(ours: Provenance, others: Provenance, indices: np.ndarray) -> Provenance:
    """Where levels of two origins come from, with their indices: the origin, if it is the same."""
    same = replace(ours, indices=indices)
    return same if same == replace(others, indices=indices) else _mixed(ours, indices)


def _mixed(origin: Provenance, indices: np.ndarray) -> Provenance:
    """The origin of levels that have several: no distribution draws them again."""
    return Provenance(origin.name, "", __version__, 0, "", indices, origin.rules)
