"""Curricula: on which levels the episodes of training begin, and what was played. One file holds one method.

Authors of curricula import from here. The modules of ``experiments`` name the file instead, so that the code that a run is
resumed under is only the code that it executes.
"""

from experiments.curricula.curriculum import Curriculum
from experiments.curricula.episodes import Ended
from experiments.curricula.explorer import Explorer, Tried
from experiments.curricula.level_rows import LevelRows
from experiments.curricula.scored_rows import ScoredRows

__all__ = ["Curriculum", "Ended", "Explorer", "LevelRows", "ScoredRows", "Tried"]
