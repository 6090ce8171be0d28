"""Baselines of returns: a random agent, an idle one, the scripted player, and the oracle, which knows the levels.

A normalised score is 0 where an agent's return is that of the uniformly random agent on the same levels, and 1 where it
is that of the planner of :mod:`segar.hardness`. The score of an idle agent can lie below 0. A score above 1 is possible,
because the planner's plan is only the best one that was found.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np
import torch

from segar.envs import VectorEnv
from segar.errors import SegarError
from segar.hardness import Plan, make_starts, plan, random_episodes
from segar.language import Factors, Task
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


class RandomAgent:
    """Acts uniformly at random, in both action modes.

    Args:
        seed: of the actions where evaluation gives no generator.
    """

    def __init__(self, seed: int = 0) -> None:
        self.rng = torch.Generator().manual_seed(seed)

    def begin(self, env: VectorEnv) -> None:
        """Episodes start in ``env``."""
        self.low, self.high = (torch.from_numpy(bound) for bound in (env.action_space.low, env.action_space.high))  # type: ignore[attr-defined]

    def act(self, observation: Any, *, rng: torch.Generator | None) -> np.ndarray:
        """Actions float32 [n, size]."""
        share = torch.rand(self.low.shape, generator=rng or self.rng)
        return torch.lerp(self.low, self.high, share).numpy()


class IdleAgent:
    """Does nothing: its action is 0, or what the task allows that is nearest to it."""

    def begin(self, env: VectorEnv) -> None:
        """Episodes start in ``env``."""
        nothing = np.clip(np.zeros(env.action_space.shape, np.float32), env.task.action_low, env.task.action_high)  # type: ignore[attr-defined]
        self.action = env.in_action_space(nothing)

    def act(self, observation: Any, *, rng: torch.Generator | None) -> np.ndarray:
        """Actions float32 [n, size]."""
        return self.action


class ScriptedAgent:
    """The task's scripted player; it sees the true factors, whatever the observation."""

    def begin(self, env: VectorEnv) -> None:
        """Episodes start in ``env``; raises :class:`SegarError` if its task has no scripted player."""
        if env.task.demo_actions is None:
            raise SegarError(f"the task {env.task.name} has no scripted player; use the oracle")
        self.env = env

    def act(self, observation: Any, *, rng: torch.Generator | None) -> np.ndarray:
        """Actions float32 [n, size]."""
        assert self.env.task.demo_actions is not None
        values = self.env.state().state.values
        return self.env.in_action_space(self.env.task.demo_actions(Factors(self.env.levels.layout, values)))


class Oracle:
    """Plays a plan: the best actions that a search found for each level, from the start of an episode to its end.

    Args:
        certificate: made for the same level set; see :func:`segar.hardness.plan`.
    """

    def __init__(self, certificate: Plan) -> None:
        self.certificate = certificate

    def begin(self, env: VectorEnv) -> None:
        """Episodes start in ``env``; raises :class:`SegarError` if the plan is for other levels or another task."""
        made = self.certificate
        if len(made) != len(env.levels) or made.task != env.task.name:
            raise SegarError(
                f"this plan is for {len(made)} levels of the task {made.task}, not for {len(env.levels)} of"
                f" {env.task.name}; make one with segar.hardness.plan"
            )
        self.env, self.level, self.step = env, env.state().state.level.copy(), 0

    def act(self, observation: Any, *, rng: torch.Generator | None) -> np.ndarray:
        """Actions float32 [n, size]; those of step t in the t-th call since :meth:`begin`."""
        # Environments whose episode has ended play on, on other levels, which nobody looks at.
        actions = self.certificate.actions[self.level, min(self.step, self.certificate.actions.shape[1] - 1)]
        self.step += 1
        return self.env.in_action_space(actions)
