"""Scores of levels: how much there may be to learn on them, read from the episodes that the agent played there.

``value_l1``: the mean size of the advantages (Jiang et al. 2021). ``positive_value_loss``: the mean of their positive parts
(Jiang et al. 2021b). ``max_mc``: the mean over steps of the best return so far on the level less the value that the agent
expected (Jiang et al. 2021b); made for tasks that reward the end alone, since a value of a later step counts later rewards
only. ``regret``: the return that the planner finds less the agent's, which needs the planner (:mod:`segar.hardness`).
"""

from typing import Any

import numpy as np

from segar.experiments.collection.saved_state import SavedState
from segar.experiments.curricula.episodes import Ended
from segar.experiments.curricula.explorer import Explorer
from segar.experiments.curricula.level_rows import LevelRows
from segar.experiments.curricula.scored_rows import ScoredRows
from segar.levels import Levels


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
