"""Levels as they come: every level of a fixed set equally often, or every level of an endless stream once.

    segar train levels=objectsx1-easy levels.count=endless

Rows hold the next levels of the stream. An episode begins on a row that no episode has begun on, and when few such rows are
left, new levels come into all others.
"""

from collections.abc import Mapping

import numpy as np

from segar.experiments.collection.saved_state import SavedState
from segar.experiments.curricula.episodes import Ended
from segar.experiments.curricula.explorer import Explorer
from segar.experiments.curricula.level_rows import LevelRows
from segar.experiments.settings import CurriculumConfig

FEWEST_ROWS, ROWS_PER_ENV = 512, 4


class Uniform(SavedState):
    """The curriculum, see :class:`segar.experiments.curricula.curriculum.Curriculum`."""

    saved = ("is_new",)

    def __init__(self, config: CurriculumConfig, rows: LevelRows, explorer: Explorer, seed: int) -> None:
        self.rows, self.num_envs = rows, rows.env.num_envs
        self.is_new = np.ones(len(rows), np.bool_)  # whether no episode has begun there

    @staticmethod
    def rows_needed(config: CurriculumConfig, num_envs: int) -> int:
        """How many levels of an endless stream environments hold at a time."""
        return max(FEWEST_ROWS, ROWS_PER_ENV * num_envs)

    def began(self, row: np.ndarray) -> np.ndarray | None:
        """Takes these rows out of the draw; two episodes that begin on one row in the same step get one each."""
        if not self.rows.is_endless:
            return None
        self.is_new[row] = False
        if self.is_new.sum() < self.num_envs:
            self.rows.fill(np.flatnonzero(~self.is_new))
            self.is_new[:] = True
        first = np.zeros(len(row), np.bool_)
        first[np.unique(row, return_index=True)[1]] = True
        instead = None
        if not first.all():
            instead = row.copy()
            instead[~first] = np.flatnonzero(self.is_new)[: (~first).sum()]
            self.is_new[instead[~first]] = False
        self.rows.weigh(self.is_new.astype(float))
        return instead

    def ended(self, ended: Ended) -> None:
        """What came of episodes changes nothing."""

    def advance(self, frames: int) -> Mapping[str, float]:
        """There is nothing to do."""
        return {}
