"""The protocol of curricula: what chooses the levels on which the episodes of training begin.

A curriculum of your own is three things: a frozen sub-class of :class:`segar.experiments.settings.CurriculumConfig` with its
settings, whose ``chooser`` names a class as ``module:Class``; that class, which has the members of :class:`Curriculum`; and
``curriculum=module:Settings`` on the command line, or a YAML in ``conf/curriculum/`` that names the settings.
:class:`segar.experiments.curricula.uniform.Uniform` is one to start from.
"""

from collections.abc import Mapping
from typing import Any, Protocol

import numpy as np

from segar.experiments.curricula.episodes import Ended
from segar.experiments.curricula.explorer import Explorer
from segar.experiments.curricula.level_rows import LevelRows


class Curriculum(Protocol):
    """What weighs the rows of levels that environments draw from, and puts other levels into them."""

    def __init__(self, config: Any, rows: LevelRows, explorer: Explorer, seed: int) -> None:
        """``rows`` are the levels, ``explorer`` tries levels out without learning; all draws follow from ``seed``."""

    @staticmethod
    def rows_needed(config: Any, num_envs: int) -> int:
        """How many levels of an endless stream environments hold at a time; at least ``num_envs``."""
        ...

    def began(self, row: np.ndarray) -> np.ndarray | None:
        """Episodes begin on these rows, int64; called in the step of the environments in which they do.

        Returns rows on which these episodes shall begin instead, or None to leave them. Levels that are put into rows here do
        not change what these episodes are on, unless they begin elsewhere.
        """

    def ended(self, ended: Ended) -> None:
        """Called for each rollout of an on-policy algorithm, where the settings say ``needs_scores``."""

    def advance(self, frames: int) -> Mapping[str, float]:
        """Called before the first and after each iteration of the learner; returns figures to log.

        Where the settings do not say ``needs_scores``, another rollout may be collected meanwhile, so levels must then be
        left alone here.
        """
        ...

    def state_dict(self) -> dict[str, Any]:
        """All that decides the further choices, as arrays and plain data; levels and weights of the rows are stored beside."""
        ...

    def load_state_dict(self, state: Mapping[str, Any]) -> None:
        """Continues from what :meth:`state_dict` returned."""
