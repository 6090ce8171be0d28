"""Baselines of returns: a random agent, an idle one, and the oracle, which knows the levels.

A normalised score is 0 where an agent's return is that of the uniformly random agent on the same levels, and 1 where it
is that of the planner of :mod:`segar.hardness`. The score of an idle agent can lie below 0. A score above 1 is possible,
because the planner's plan is only the best one that was found.
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
    """Mean full returns on a level set: of a uniformly random agent, and of the oracle."""

    random: float
    oracle: float

    def normalised(self, value: Any) -> Any:
        """The score of a mean return on the same levels: 0 for the random agent's, 1 for the oracle's; float or array.

        NaN where the oracle is no better than chance, as on levels that nobody can influence.
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
    """The baselines of a level set, each level counted equally; about 0.1 s per level.

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
    oracle = plan(levels, task, rng=rng, samples=samples, iterations=iterations, num_threads=num_threads)
    return Baselines(random=float(returns.mean()), oracle=float(oracle.returns.mean()))


def idle_actions(env: VectorEnv) -> np.ndarray:
    """The actions of an agent that does nothing, float32 ``(num_envs, action size)``: 0, or what the task allows nearest to
    it, as the action space of ``env`` has it."""
    task, n = env.task, env.num_envs
    nothing = np.clip(np.zeros((n, len(task.action_low)), np.float32), task.action_low, task.action_high)
    return env.in_action_space(nothing)
