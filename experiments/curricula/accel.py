"""ACCEL (Parker-Holder et al. 2022): robust PLR, in which replayed levels are also mutated, and their children tried.

    python -m experiments.train suite=place-few-v1 levels.count=endless curriculum=accel

A child differs from its parent in ``changes`` factors, positions, shapes, entities or world parameters, drawn anew from their
priors (:func:`segar.mutate`), so that it is a level of the distribution. Children that are levels of a suite's test are left.
"""

from collections.abc import Mapping
from typing import Any

import numpy as np

from experiments.curricula.episodes import Ended
from experiments.curricula.explorer import Explorer
from experiments.curricula.level_rows import LevelRows
from experiments.curricula.robust_plr import RobustPLR
from experiments.settings import ACCELConfig
from segar.levels import Levels, mutate, near_levels

MUTATING = 3  # names the random stream


class ACCEL:
    """The curriculum, see :class:`experiments.curricula.curriculum.Curriculum`."""

    starts_anew = True  # as robust PLR

    def __init__(self, config: ACCELConfig, rows: LevelRows, explorer: Explorer, seed: int) -> None:
        self.config, self.rows, self.seed = config, rows, seed
        self.replay = RobustPLR(config, rows, explorer, seed)
        self.due = 0.0  # children that are to be tried
        self.generations = 0

    @staticmethod
    def rows_needed(config: ACCELConfig, num_envs: int) -> int:
        """How many levels of an endless stream environments hold at a time."""
        return RobustPLR.rows_needed(config, num_envs)

    def began(self, row: np.ndarray) -> None:
        """Takes note of the time, and of children that are due."""
        self.replay.began(row)
        self.due += self.config.children * len(row)

    def ended(self, ended: Ended) -> None:
        """Scores the levels of these episodes."""
        self.replay.ended(ended)

    def advance(self, frames: int) -> Mapping[str, float]:
        """Tries as many new levels and children as are due, and weighs the rows."""
        figures, batch, taken = dict(self.replay.advance(frames)), self.config.batch, 0
        due = int(self.due) // batch * batch
        self.due -= due
        children = self.children(due) if due else None
        if children is not None:
            for first in range(0, len(children), batch):
                taken += self.replay.offer(children[first : first + batch], made=True)
        self.replay.weigh()
        return {**figures, **self.replay.figures(), "children_taken": float(taken)}

    def children(self, n: int) -> Levels | None:
        """At most ``n`` mutated levels, whose parents are drawn as replays are; None where all are levels of the test."""
        self.generations += 1
        rng = np.random.default_rng([self.seed, MUTATING, self.generations])
        likely = self.replay.known.replay_probabilities(self.config)
        parents = rng.choice(len(likely), n, p=likely / likely.sum())
        found = mutate(self.rows.levels[parents], rng, self.config.changes)
        stream = self.rows.stream
        if stream is None or stream.apart_from is None:
            return found
        left = np.flatnonzero(~near_levels(found, stream.apart_from, 0.0, stream.distribution))
        return found[left] if len(left) else None

    def scores(self) -> np.ndarray:
        """Of the levels in all rows, nan where there is none."""
        return self.replay.scores()

    def state_dict(self) -> dict[str, Any]:
        """That of robust PLR, and which children are due."""
        return {"replay": self.replay.state_dict(), "due": self.due, "generations": self.generations}

    def load_state_dict(self, state: Mapping[str, Any]) -> None:
        """Continues from ``state``."""
        self.replay.load_state_dict(state["replay"])
        self.due, self.generations = state["due"], state["generations"]
