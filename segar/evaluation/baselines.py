"""Baselines of returns: a random agent, an idle one, and the best known, which a planner finds.

A normalised score is 0 where an agent's return is that of the uniformly random agent on the same levels, and 1 where it
is that of the planner of :mod:`segar.hardness`, which knows the levels. The score of an idle agent can lie below 0. A score
above 1 is possible: the planner is a search, and its plan is the best one that is known, not an optimum.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np

from segar.envs import VectorEnv
from segar.errors import SegarError
from segar.hardness import make_starts, plan, random_episodes
from segar.language import Task
from segar.levels import Levels

RANDOM_PLAYS = 20  # random episodes per level
SAMPLES, ITERATIONS = 64, 5  # of the search, per level


@dataclass(frozen=True)
class Baselines:
    """Full returns on a level set.

    Attributes:
        random: mean return of a uniformly random agent.
        best_known: return of the planner's best episode on each level, float64 ``[level]``.
    """

    random: float
    best_known: np.ndarray

    @property
    def oracle(self) -> float:
        """The mean best known return."""
        return float(self.best_known.mean())

    def normalised(self, value: Any) -> Any:
        """The score of a mean return on the same levels: 0 for the random agent's, 1 for the best known; float or array.

        NaN where the best known return is no better than chance, as on levels that nobody can influence.
        """
        span = self.oracle - self.random
        return (np.asarray(value, float) - self.random) / (span if span > 0 else np.nan)


def find_baselines(
    levels: Levels,
    task: Task | None = None,
    *,
    rng: np.random.Generator,
    plays: int = RANDOM_PLAYS,
    samples: int = SAMPLES,
    iterations: int = ITERATIONS,
    num_threads: int = 1,
) -> Baselines:
    """The baselines of a level set, each level counted equally; about 0.1 s per level with the default search.

    Args:
        task: what is played; the task of the levels where it is None.
        rng: of the random agent and of the search.
        plays: random episodes per level.
        samples, iterations: of the search; see :func:`segar.hardness.plan`.

    Raises:
        SegarError: plays, samples or iterations are too few, or the levels do not fit the task.
    """
    if plays < 1:
        raise SegarError(f"baselines need at least 1 random play per level, not {plays}")
    _, returns = random_episodes(make_starts(levels, task, num_threads=num_threads), plays, rng)
    best = plan(levels, task, rng=rng, samples=samples, iterations=iterations, num_threads=num_threads)
    return Baselines(random=float(returns.mean()), best_known=best.returns)


def idle_actions(env: VectorEnv) -> np.ndarray:
    """The actions of an agent that does nothing, float32 ``(num_envs, action size)``: 0, or what the task allows nearest to
    it, as the action space of ``env`` has it."""
    task, n = env.task, env.num_envs
    nothing = np.clip(np.zeros((n, len(task.action_low)), np.float32), task.action_low, task.action_high)
    return env.in_action_space(nothing)
