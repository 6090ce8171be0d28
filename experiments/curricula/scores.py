"""Scores of levels: how much there may be to learn on them, read from the episodes that the agent played there.

``value_l1``: the mean size of the advantages (Jiang et al. 2021). ``positive_value_loss``: the mean of their positive parts
(Jiang et al. 2021b). ``max_mc``: the mean over steps of the best return so far on the level less the value that the agent
expected (Jiang et al. 2021b); made for tasks that reward the end alone, since a value of a later step counts later rewards
only. ``regret``: the return that the planner finds less the agent's, which needs the planner (:mod:`segar.hardness`).

Scores, ranks and the time since levels were played say which of them are worth another episode (Jiang et al. 2021).
"""

from typing import Any

import numpy as np

from segar.experiments.collection.saved_state import SavedState
from segar.experiments.curricula.episodes import Ended
from segar.experiments.curricula.explorer import Explorer
from segar.experiments.curricula.level_rows import LevelRows
from segar.experiments.settings import ReplayConfig
from segar.levels import Levels


class ScoredRows(SavedState):
    """What is known of the levels in a number of rows.

    Attributes:
        score: float64 ``(rows,)``, nan where a level was not scored yet.
        played: int64 ``(rows,)``, how many episodes had begun when the last one began there.
        best_return: float64, of the episodes on the level so far, as it is learned from; -inf before the first.
        planned: float64, the return that the planner found, nan where it was not asked.
        episodes: how many began.
    """

    saved = ("score", "played", "best_return", "planned", "episodes")

    def __init__(self, rows: int) -> None:
        self.score, self.planned = np.full(rows, np.nan), np.full(rows, np.nan)
        self.played = np.zeros(rows, np.int64)
        self.best_return = np.full(rows, -np.inf)
        self.episodes = 0

    @property
    def is_scored(self) -> np.ndarray:
        """Bool ``(rows,)``."""
        return ~np.isnan(self.score)

    def began(self, row: np.ndarray) -> None:
        """Episodes began on these rows."""
        self.episodes += len(row)
        self.played[row] = self.episodes

    def forget(self, rows: np.ndarray) -> None:
        """Other levels are in these rows now."""
        self.score[rows] = self.planned[rows] = np.nan
        self.best_return[rows] = -np.inf
        self.played[rows] = self.episodes

    def replay_probabilities(self, config: ReplayConfig) -> np.ndarray:
        """Float64 ``(rows,)``: (1 - rho) P_S + rho P_C over rows with a score; 0 elsewhere, and everywhere if there are none.

        P_S is in proportion to (1 / rank)^(1 / beta), the highest score having rank 1; P_C in proportion to the number of
        episodes that began since the level was played. Jiang et al. 2021, equations 3 to 5.
        """
        rows, found = np.flatnonzero(self.is_scored), np.zeros(len(self.score))
        if not len(rows):
            return found
        order = np.argsort(-self.score[rows], kind="stable")
        rank = np.empty(len(rows))
        rank[order] = np.arange(1, len(rows) + 1)
        by_score = rank ** (-1.0 / config.temperature)
        stale = (self.episodes - self.played[rows]).astype(float)
        by_time = stale if stale.sum() > 0 else np.ones(len(rows))
        rho = config.staleness
        found[rows] = (1 - rho) * by_score / by_score.sum() + rho * by_time / by_time.sum()
        return found

    def worst(self, most: int) -> np.ndarray:
        """The rows with the lowest scores, without which ``most`` rows with a score are left."""
        rows = np.flatnonzero(self.is_scored)
        return rows[np.argsort(self.score[rows], kind="stable")][: max(len(rows) - most, 0)]

    def places_for(self, score: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Which of some levels with these scores are taken in, and into which rows: two int arrays of equal length.

        Rows without a score are filled first; then a level with a higher score takes the place of the lowest one.
        """
        ours = np.where(self.is_scored, self.score, -np.inf)
        everyone = np.concatenate([ours, score])
        kept = np.argsort(-everyone, kind="stable")[: len(ours)]
        taken = np.sort(kept[kept >= len(ours)]) - len(ours)
        free = np.setdiff1d(np.arange(len(ours)), kept)
        return taken, free


class ScoringCurriculum(SavedState):
    """What curricula that score levels share; see :class:`segar.experiments.curricula.curriculum.Curriculum`."""

    parts = ("known",)

    def __init__(self, config: Any, rows: LevelRows, explorer: Explorer, seed: int) -> None:
        self.config, self.rows, self.explorer, self.seed = config, rows, explorer, seed
        self.known = ScoredRows(len(rows))

    def scored(self, ended: Ended) -> np.ndarray:
        """The score of the level of each episode, float64."""
        return scores_of(self.config.score, ended, self.rows.levels, self.known, self.explorer)

    def scores(self) -> np.ndarray:
        """Of the levels in all rows, nan where there is none."""
        return self.known.score


def scores_of(name: str, ended: Ended, levels: Levels, known: ScoredRows, explorer: Explorer) -> np.ndarray:
    """The score ``name`` of the level of each episode, float64.

    Args:
        levels: that the rows of ``ended`` mean.
        known: of these levels; keeps best returns, and what the planner found, so that it is asked once for each level.
    """
    np.maximum.at(known.best_return, ended.row, ended.learned_return)
    if name == "max_mc":
        return known.best_return[ended.row] - ended.mean_value
    if name == "regret":
        new = np.unique(ended.row[np.isnan(known.planned[ended.row])])
        if len(new):
            known.planned[new] = explorer.best_returns(levels[new])
        return np.maximum(known.planned[ended.row] - ended.returns, 0.0)
    return getattr(ended, name)
