"""The levels that environments draw from while they run: rows that a curriculum weighs and fills."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from segar.envs import LevelPool, VectorEnv
from segar.experiments.levels.endless import Stream
from segar.levels import Levels

MADE = -1  # the number of a level that a curriculum made, which no index of the training split names


class LevelRows:
    """The rows of a batch of environments.

    Attributes:
        env: the environments; only this object replaces their levels.
        stream: where new levels come from; None for a fixed set.
        number: int64 ``(rows,)``, index of each row's level in the fixed set or in the training split, or ``MADE``.
        identity: int64 ``(rows,)``, a number that no other level of the run has or had.
    """

    def __init__(self, env: VectorEnv, stream: Stream | None) -> None:
        self.env, self.stream = env, stream
        self.number = np.array(env.levels.provenance.indices if stream is not None else np.arange(len(env.levels)))
        self.identity = np.arange(len(self.number))

    def __len__(self) -> int:
        return len(self.number)

    @property
    def levels(self) -> Levels:
        """The levels that rows hold now."""
        return self.env.levels

    @property
    def is_endless(self) -> bool:
        """Whether there are new levels."""
        return self.stream is not None

    def fill(self, rows: np.ndarray) -> None:
        """Puts new levels of the stream into these rows; episodes that run there go on."""
        if len(rows):
            self.put(rows, self.take(len(rows)))

    def take(self, n: int) -> Levels:
        """``n`` new levels of the stream, which are in no row."""
        assert self.stream is not None  # a fixed set has no new levels; start.py refuses what would need them
        return self.stream.take(n)

    def put(self, rows: np.ndarray, levels: Levels, made: bool = False) -> None:
        """Puts levels into rows, each named once; ``made`` says that they are not of the training split."""
        self.env.replace_levels(rows, levels)
        self.number[rows] = MADE if made else levels.provenance.indices
        self.identity[rows] = self.identity.max() + 1 + np.arange(len(rows))  # the newest level is in a row

    def weigh(self, weights: np.ndarray | None) -> None:
        """Has episodes begin on rows in proportion to these weights, equally often where there are none above 0."""
        self.env.set_level_weights(weights if weights is not None and weights.sum() > 0 else None)

    def state_dict(self) -> dict[str, Any]:
        """The levels with their weights, names and origins."""
        stream = {} if self.stream is None else {"next": self.stream.next}
        return {"pool": self.env.pool.arrays(), "number": self.number, "identity": self.identity, **stream}

    def load_state_dict(self, state: Mapping[str, Any]) -> LevelPool:
        """Continues from ``state``; returns the pool that the environments are to be restored with."""
        self.number, self.identity = state["number"].copy(), state["identity"].copy()
        if self.stream is not None:
            self.stream.next, self.stream.block = state["next"], None
        return self.env.pool.with_arrays(state["pool"])
