"""Baselines of returns on each level: random play, an idle agent, and the best known return, which a planner finds.

A normalised score is a ratio of means over levels: it is 0 where an agent's mean return is the mean of the better of idle and
random play on each level, and 1 where it is that of the planner of :mod:`segar.hardness`, which knows the levels. An idle
agent never scores above 0, and a random one only by chance. A score above 1 is possible: the planner is a search, and its
plan is the best one that is known, not an optimum. The regret is what an agent's mean return lacks of the planner's.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np

from segar.evaluation.episodes import play_episodes
from segar.evaluation.players import Idle
from segar.hardness import Plan, make_starts, plan, random_episodes
from segar.language import Task
from segar.levels import Levels, checks

RANDOM_PLAYS = 20  # random episodes per level
ROUNDING = 1e-12  # by which figures may differ that are all alike, as a part of them
SAMPLES, ITERATIONS = 64, 5  # of the search, per level


@dataclass(frozen=True, eq=False)
class Baselines:
    """Full returns on each level of a set, all float64 ``[level]``.

    Attributes:
        random: mean return of a uniformly random agent.
        idle: return of an agent that does nothing.
        oracle: return of the planner's best episode.
        plan: these episodes; None where the returns come from elsewhere.
    """

    random: np.ndarray
    idle: np.ndarray
    oracle: np.ndarray
    plan: Plan | None = None

    @property
    def floor(self) -> np.ndarray:
        """The better of idle and random play on each level, float64 ``[level]``."""
        return np.maximum(self.random, self.idle)

    def normalised(self, value: Any) -> Any:
        """The score of a mean return on the same levels: 0 for the mean floor, 1 for the planner's mean; float or array.

        NaN where the planner's mean is no better than the floor's, as on levels that nobody can influence.
        """
        low, span = self.floor.mean(), self.oracle.mean() - self.floor.mean()
        return (np.asarray(value, float) - low) / (span if span > ROUNDING * abs(low) else np.nan)

    def regret(self, value: Any) -> Any:
        """The planner's mean return less a mean return on the same levels, in units of return; float or array."""
        return self.oracle.mean() - np.asarray(value, float)


def find_baselines(
    levels: Levels,
    task: Task | None = None,
    *,
    rng: np.random.Generator,
    seed: int = 0,
    plays: int = RANDOM_PLAYS,
    samples: int = SAMPLES,
    iterations: int = ITERATIONS,
    num_threads: int = 1,
) -> Baselines:
    """The baselines of a level set; about 0.1 s per level with the default search.

    Args:
        task: what is played; the task of the levels where it is None.
        rng: of the random agent and of the search.
        seed: of the randomness in rules, for the idle agent and the search.
        plays: random episodes per level.
        samples, iterations: of the search; see :func:`segar.hardness.plan`.

    Raises:
        SegarError: plays, samples or iterations are too few, or the levels do not fit the task.
    """
    checks.require_count("baselines", "random play per level", plays, 1)
    _, returns = random_episodes(make_starts(levels, task, seed, num_threads), plays, rng)
    idle = play_episodes(levels, np.arange(len(levels)), Idle(), seed=seed, task=task, num_threads=num_threads)
    best = plan(levels, task, rng=rng, samples=samples, iterations=iterations, seed=seed, num_threads=num_threads)
    return Baselines(returns.mean(axis=1), idle.returns, best.returns, best)
