"""Prioritised level replay (Jiang et al. 2021): levels from which there is something to learn come back.

    segar train suite=place-few-v1 levels.count=endless curriculum=plr

An episode is on a level that was scored before with probability ``replay``, and else on a new one. Of a fixed set, new levels
are those that no episode began on; once there are none, all episodes replay. Of an endless stream, the ``capacity`` levels of
the highest scores are kept.
"""

from collections.abc import Mapping

import numpy as np

from segar.experiments.curricula.episodes import Ended
from segar.experiments.curricula.explorer import Explorer
from segar.experiments.curricula.level_rows import LevelRows
from segar.experiments.curricula.scores import ScoringCurriculum
from segar.experiments.settings import PLRConfig

ROWS_PER_ENV = 8  # of new levels, beside those that are kept


class PLR(ScoringCurriculum):
    """The curriculum, see :class:`segar.experiments.curricula.curriculum.Curriculum`."""

    saved = ("is_new", "is_left", "replay", "begun", "replayed")

    def __init__(self, config: PLRConfig, rows: LevelRows, explorer: Explorer, seed: int) -> None:
        super().__init__(config, rows, explorer, seed)
        self.is_new = np.ones(len(rows), np.bool_)  # whether no episode began there
        self.is_left = np.zeros(len(rows), np.bool_)  # whether the level is not worth keeping
        self.replay = np.zeros(len(rows))  # probabilities of the rows among replays; all 0 before the first
        self.begun = self.replayed = 0  # episodes since the last figures

    @staticmethod
    def rows_needed(config: PLRConfig, num_envs: int) -> int:
        """How many levels of an endless stream environments hold at a time."""
        return config.capacity + ROWS_PER_ENV * num_envs

    def began(self, row: np.ndarray) -> None:
        """Takes note of the time; new levels are no longer new, though they may be drawn again until the rollout ends."""
        self.known.began(row)
        self.begun += len(row)
        self.replayed += int(self.known.is_scored[row].sum())
        if not self.is_new[row].any():
            return
        self.is_new[row] = False
        if self.rows.is_endless and self.is_new.sum() < self.rows.env.num_envs and self.is_left.any():
            left = np.flatnonzero(self.is_left)
            self.rows.fill(left)
            self.known.forget(left)
            self.is_new[left], self.is_left[left] = True, False
            self._weigh()

    def ended(self, ended: Ended) -> None:
        """Scores the levels of these episodes, and leaves those of the lowest scores where there are too many."""
        scores = self.scored(ended)
        there = ~self.is_left[ended.row]
        self.known.score[ended.row[there]] = scores[there]
        if self.rows.is_endless:
            left = self.known.worst(self.config.capacity)
            self.known.score[left] = np.nan
            self.is_left[left] = True

    def advance(self, frames: int) -> Mapping[str, float]:
        """Weighs the rows by their scores and by the time since they were played."""
        kept = self.config.capacity if self.rows.is_endless else len(self.rows)
        scored = self.known.score[self.known.is_scored]
        if len(scored) and len(scored) >= self.config.min_scored * kept:
            self.replay = self.known.replay_probabilities(self.config)
        self._weigh()
        figures = {"scored": float(len(scored)), "replayed": self.replayed / max(self.begun, 1)}
        self.begun = self.replayed = 0
        return figures | ({"score": float(scored.mean())} if len(scored) else {})

    def _weigh(self) -> None:
        """Has the environments draw a replay with its probability, and else a new level, each equally often."""
        new = self.is_new.astype(float)
        if not new.any() or not self.replay.any():
            self.rows.weigh(self.replay if self.replay.any() else new)
            return
        share = self.config.replay
        self.rows.weigh(share * self.replay / self.replay.sum() + (1 - share) * new / new.sum())
