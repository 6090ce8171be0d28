"""Curricula: on which levels the episodes of training begin, and what was played. One file holds one method.

Authors of curricula import from here. The modules of ``experiments`` name the file instead, so that the code that a run is
resumed under is only the code that it executes.
"""

from segar.experiments.curricula.curriculum import Curriculum
from segar.experiments.curricula.episodes import Ended
from segar.experiments.curricula.explorer import Explorer, Tried
from segar.experiments.curricula.level_rows import LevelRows
from segar.experiments.curricula.scores import ScoredRows

__all__ = ["Curriculum", "Ended", "Explorer", "LevelRows", "ScoredRows", "Tried"]
