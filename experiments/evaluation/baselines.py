"""Agents without training: a random one, an idle one, the scripted player, and the best known, which a planner finds."""

from typing import Any

import numpy as np
import torch

from segar.envs import VectorEnv
from segar.errors import SegarError
from segar.evaluation import idle_actions
from segar.hardness import Plan
from segar.language import Factors


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
        self.action = idle_actions(env)

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
        values = self.env.state().state.values
        return self.env.in_action_space(self.env.task.scripted_actions(Factors(self.env.levels.layout, values)))


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
