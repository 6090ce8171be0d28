"""ACCEL (Parker-Holder et al. 2022): robust PLR, in which replayed levels are also mutated, and their children tried.

    segar train suite=place-few-v1 levels.count=endless curriculum=accel

A child differs from its parent in ``changes`` factors, positions, shapes, entities or world parameters, drawn anew from their
priors (:func:`segar.mutate`), so that it is a level of the distribution. Children that are levels of a suite's test are left.
"""

from collections.abc import Mapping

import numpy as np

from segar.experiments.curricula.robust_plr import RobustPLR
from segar.experiments.settings import ACCELConfig
from segar.levels import Levels, mutate, near_levels

MUTATING = 3  # names the random stream


class ACCEL(RobustPLR):
    """The curriculum, see :class:`segar.experiments.curricula.curriculum.Curriculum`."""

    saved = (*RobustPLR.saved, "children_due", "generations")
    config: ACCELConfig
    children_due = 0.0  # that are to be tried
    generations = 0

    def began(self, row: np.ndarray) -> None:
        """Takes note of the time, and of children that are due."""
        super().began(row)
        self.children_due += self.config.children * len(row)

    def advance(self, frames: int) -> Mapping[str, float]:
        """Tries as many new levels and children as are due, and weighs the rows."""
        figures, batch, taken = dict(super().advance(frames)), self.config.batch, 0
        due = int(self.children_due) // batch * batch
        self.children_due -= due
        children = self.children(due) if due else None
        if children is not None:
            for first in range(0, len(children), batch):
                taken += self.offer(children[first : first + batch], made=True)
        self.weigh()
        return {**figures, **self.figures(), "children_taken": float(taken)}

    def children(self, n: int) -> Levels | None:
        """At most ``n`` mutated levels, whose parents are drawn as replays are; None where all are levels of the test."""
        self.generations += 1
        rng = np.random.default_rng([self.seed, MUTATING, self.generations])
        likely = self.known.replay_probabilities(self.config)
        parents = rng.choice(len(likely), n, p=likely / likely.sum())
        found = mutate(self.rows.levels[parents], rng, self.config.changes)
        stream = self.rows.stream
        if stream is None or stream.apart_from is None:
            return found
        left = np.flatnonzero(~near_levels(found, stream.apart_from, 0.0, stream.distribution))
        return found[left] if len(left) else None
