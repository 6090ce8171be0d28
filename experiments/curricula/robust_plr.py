"""Robust PLR (Jiang et al. 2021b): new levels are tried and scored, and the agent learns on replayed levels alone.

    segar train suite=place-few-v1 levels.count=endless curriculum=plr_robust

So many new levels are tried that the share ``replay`` of all episodes is on replayed ones. The steps in which levels are tried
count as frames, unless ``counts_tried`` is false.
"""

from collections.abc import Mapping

import numpy as np

from segar.experiments.curricula.episodes import Ended
from segar.experiments.curricula.scores import ScoredRows, ScoringCurriculum, scores_of
from segar.experiments.settings import RobustPLRConfig
from segar.levels import Levels


class RobustPLR(ScoringCurriculum):
    """The curriculum, see :class:`segar.experiments.curricula.curriculum.Curriculum`."""

    saved = ("due", "begun")
    starts_anew = True  # episodes that began before levels were scored are left
    due = 0.0  # new levels that are to be tried
    begun = 0  # episodes since the last call of advance

    @staticmethod
    def rows_needed(config: RobustPLRConfig, num_envs: int) -> int:
        """How many levels of an endless stream environments hold at a time."""
        return config.capacity

    def began(self, row: np.ndarray) -> None:
        """Takes note of the time."""
        self.known.began(row)
        self.begun += len(row)

    def ended(self, ended: Ended) -> None:
        """Scores the levels of these episodes."""
        self.known.score[ended.row] = self.scored(ended)

    def advance(self, frames: int) -> Mapping[str, float]:
        """Tries as many new levels as are due, and weighs the rows."""
        enough = max(self.config.min_scored * len(self.rows), 1)
        self.due += self.begun * (1 - self.config.replay) / self.config.replay
        self.begun = 0
        taken = 0
        while self.known.is_scored.sum() < enough or self.due >= self.config.batch:
            self.due = max(self.due - self.config.batch, 0.0)
            taken += self.offer(self.rows.take(self.config.batch))
        self.weigh()
        return {**self.figures(), "taken": float(taken)}

    def offer(self, levels: Levels, made: bool = False) -> int:
        """Tries levels, and keeps those whose scores are higher than the lowest so far; returns how many."""
        tried = self.explorer.try_levels(levels).ended
        candidates = ScoredRows(len(levels))
        score = scores_of(self.config.score, tried, levels, candidates, self.explorer)
        taken, places = self.known.places_for(score)
        if not len(taken):
            return 0
        self.known.forget(places)
        self.rows.put(places, levels[taken], made)
        self.known.score[places] = score[taken]
        self.known.best_return[places] = candidates.best_return[taken]
        self.known.planned[places] = candidates.planned[taken]
        return len(taken)

    def weigh(self) -> None:
        """Has the environments draw levels by their scores and by the time since they were played."""
        self.rows.weigh(self.known.replay_probabilities(self.config))

    def figures(self) -> dict[str, float]:
        """How many levels have scores, and their mean."""
        scored = self.known.score[self.known.is_scored]
        return {"scored": float(len(scored)), "score": float(scored.mean()) if len(scored) else 0.0}
