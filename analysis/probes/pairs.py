"""Pairs of representation and true factors, frame by frame, with the episodes that they come from."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from segar.analysis.tables import Floats, Ints
from segar.errors import LevelError
from segar.noise import Noise

BATCH = 512  # observations that are represented at once
NAME_OF_TYPE = "type"


@dataclass(frozen=True)
class Column:
    """One number of the true state: which it is, and what is known of it before any frame is seen.

    ``law`` is that of its first value in an episode, given that the slot holds something that has it; None where it
    has no law of its own. ``is_static``: it stays what it was at the beginning of the episode.
    """

    slot: str  # name of the entity's slot, or "world"
    factor: str  # "Position.x", "Mass", "type", or a world parameter
    is_category: bool = False
    is_static: bool = False
    law: Noise | None = None

    @property
    def name(self) -> str:
        """E.g. ``golfball.Position.x``."""
        return f"{self.slot}.{self.factor}"


@dataclass(frozen=True)
class Pairs:
    """``N`` frames: what a network makes of each, and what is true of it at the same time.

    Attributes:
        representation: float32 ``[N, d]``.
        factors: float64 ``[N, k]``; nan where an entity is absent or lacks the factor; numbers of types for categories.
        columns: what the ``k`` factors are.
        episode: int ``[N]``; frames of one episode depend on each other, so splits and intervals go by episodes.
    """

    representation: NDArray[np.float32]
    factors: Floats
    columns: tuple[Column, ...]
    episode: Ints

    def __len__(self) -> int:
        return len(self.factors)

    def only(self, columns: Sequence[int]) -> Pairs:
        """The factors at these places alone."""
        chosen = list(columns)
        return replace(self, factors=self.factors[:, chosen], columns=tuple(self.columns[k] for k in chosen))

    def with_representation(self, representation: Any) -> Pairs:
        """The same frames, represented otherwise; ``[N, d]``."""
        return replace(self, representation=np.asarray(representation, np.float32))


@dataclass(frozen=True)
class Frames:
    """``N`` frames as an agent saw them, and what was true of them; see :class:`Pairs`.

    ``late`` holds the factors one step later, float64 ``[N, k]``: after the last step of an episode they are those of
    the next episode's first state. The code of 2022 paired frames with these. ``level`` is the index in the level set, int
    ``[N]``, and ``step`` the steps since the episode began, int ``[N]``.
    """

    observation: NDArray[Any]
    factors: Floats
    late: Floats
    columns: tuple[Column, ...]
    episode: Ints
    level: Ints
    step: Ints

    def __len__(self) -> int:
        return len(self.factors)

    def pairs(self, represent: Callable[[NDArray[Any]], NDArray[Any]]) -> Pairs:
        """What ``represent`` makes of the observations ``[n, ...]``, beside the factors."""
        parts = [represent(self.observation[i : i + BATCH]) for i in range(0, len(self), BATCH)]
        phi = np.concatenate([np.asarray(part, np.float32).reshape(len(part), -1) for part in parts])
        return Pairs(phi, self.factors, self.columns, self.episode)


def episode_folds(episode: Ints, folds: int, rng: np.random.Generator) -> list[Ints]:
    """Disjoint index arrays that together hold all frames, no episode in two of them; sizes as even as whole episodes allow.

    Raises:
        LevelError: there are fewer episodes than folds.
    """
    names, place, size = np.unique(episode, return_inverse=True, return_counts=True)
    if len(names) < folds:
        raise LevelError(
            f"{folds} folds need at least {folds} episodes, not {len(names)}; collect more frames, or from more"
            " environments at once"
        )
    order = rng.permutation(len(names))
    order = order[np.argsort(-size[order], kind="stable")]
    fold_of, filled = np.empty(len(names), np.int64), np.zeros(folds)
    for one in order:  # the longest first, each into the emptiest fold
        fold_of[one] = filled.argmin()
        filled[fold_of[one]] += size[one]
    return [np.flatnonzero(fold_of[place] == fold) for fold in range(folds)]


def standardised(factors: Floats, columns: Sequence[Column] | None = None) -> NDArray[np.float32]:
    """Factors ``[N, k]`` as a critic can read them, ``[N, m]``.

    Numbers lie around 0 with spread 1, 0 where they are missing; categories become one column each; a column of zeros
    and ones says where a number is there, if it is not always; columns that do not vary are left out.
    """
    parts = []
    for k in range(factors.shape[1]):
        x = factors[:, k]
        there = np.isfinite(x)
        if not there.any():
            continue
        if not there.all():
            parts.append(there.astype(float))
        if columns is not None and columns[k].is_category:
            parts.extend((x == value).astype(float) for value in np.unique(x[there]))
        elif x[there].std() > 1e-12 * np.abs(x[there]).max():  # what rounding leaves of a constant is no variation
            parts.append(np.where(there, x - x[there].mean(), 0.0))
    if not (varied := [part for part in parts if part.std() > 0]):
        raise LevelError("no factor varies in these frames: there is nothing to be known about them")
    return np.stack([(part - part.mean()) / part.std() for part in varied], axis=1).astype(np.float32)


def standardised_representation(x: NDArray[Any]) -> NDArray[np.float32]:
    """``[N, d]`` around 0 with spread 1 in every column; columns that do not vary are 0."""
    x = np.asarray(x, np.float64)
    spread = x.std(axis=0)
    spread[spread <= 1e-12 * np.abs(x).max(axis=0)] = np.inf  # what rounding leaves of a constant, in any unit
    return ((x - x.mean(axis=0)) / spread).astype(np.float32)
