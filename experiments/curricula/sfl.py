"""Sampling for learnability (Rutherford et al. 2024): the agent trains on levels that it solves sometimes.

    segar train suite=place-few-v1 levels.count=endless curriculum=sfl

Every ``interval`` frames, the agent plays ``episodes`` episodes on each of ``candidates`` levels. A level on which the share p
of them succeeds has the learnability p (1 - p). The ``kept`` levels of the highest learnability above 0 get the share
``share`` of the episodes that follow, equally often; the others are on levels as they come.
"""

from collections.abc import Mapping

import numpy as np

from segar.experiments.collection.saved_state import SavedState
from segar.experiments.curricula.episodes import Ended
from segar.experiments.curricula.explorer import Explorer
from segar.experiments.curricula.level_rows import LevelRows
from segar.experiments.curricula.uniform import Uniform
from segar.experiments.settings import SFLConfig


class SFL(SavedState):
    """The curriculum, see :class:`segar.experiments.curricula.curriculum.Curriculum`."""

    saved = ("is_new", "is_kept", "next")

    def __init__(self, config: SFLConfig, rows: LevelRows, explorer: Explorer, seed: int) -> None:
        self.config, self.rows, self.explorer = config, rows, explorer
        self.is_new = np.ones(len(rows), np.bool_)  # whether no episode began there; of an endless stream
        self.is_kept = np.zeros(len(rows), np.bool_)
        self.next = 0  # frames from which the next choice is due

    @staticmethod
    def rows_needed(config: SFLConfig, num_envs: int) -> int:
        """How many levels of an endless stream environments hold at a time."""
        return config.kept + Uniform.rows_needed(config, num_envs)

    def began(self, row: np.ndarray) -> None:
        """Levels of the stream on which episodes begin are no longer new."""
        if not self.rows.is_endless or not self.is_new[row].any():
            return
        self.is_new[row] = False
        if self.is_new.sum() < self.rows.env.num_envs:
            used = np.flatnonzero(~self.is_new & ~self.is_kept)
            self.rows.fill(used)
            self.is_new[used] = True
        self._weigh()

    def ended(self, ended: Ended) -> None:
        """Episodes of training change nothing; levels are chosen by those that are tried."""

    def advance(self, frames: int) -> Mapping[str, float]:
        """Chooses levels where it is time."""
        if frames < self.next:
            return {}
        self.next = frames + self.config.interval
        levels = self.rows.take(self.config.candidates) if self.rows.is_endless else self.rows.levels
        rate = self.explorer.try_levels(levels, self.config.episodes).success_rate(len(levels))
        learnability = rate * (1 - rate)
        best = np.argsort(-learnability, kind="stable")[: self.config.kept]
        best = best[learnability[best] > 0]
        self.is_kept[:] = False
        if self.rows.is_endless:
            places = np.arange(len(best))
            self.rows.put(places, levels[best]) if len(best) else None
            self.is_new[places], self.is_kept[places] = False, True
        else:
            self.is_kept[best] = True
        self._weigh()
        mean = float(learnability[best].mean()) if len(best) else 0.0
        return {"kept": float(len(best)), "learnability": mean, "success_of_candidates": float(rate.mean())}

    def _weigh(self) -> None:
        kept = self.is_kept.astype(float)
        others = self.is_new.astype(float) if self.rows.is_endless else np.ones(len(kept))
        if not kept.any():
            self.rows.weigh(others if self.rows.is_endless else None)
            return
        share = self.config.share
        self.rows.weigh(share * kept / kept.sum() + (1 - share) * others / max(others.sum(), 1))
