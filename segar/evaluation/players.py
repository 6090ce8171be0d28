"""Policies without training: one that does nothing, a random one, and the task's scripted player."""

from typing import Any

import numpy as np

from segar.envs import VectorEnv


class Idle:
    """The policy that does nothing: its action is 0, or what the task allows nearest to it."""

    def begin(self, env: VectorEnv) -> None:
        """Episodes start in ``env``."""
        zero = np.zeros((env.num_envs, len(env.task.action_low)), np.float32)
        self.actions = env.action_range.of_space(np.clip(zero, env.task.action_low, env.task.action_high))

    def __call__(self, observations: Any) -> np.ndarray:
        """Actions float32 ``(n, action size)``."""
        return self.actions


class Random:
    """The policy that acts uniformly at random; ``seeds`` and the number of the batch decide its draws."""

    def __init__(self, *seeds: int) -> None:
        self.seeds, self.batch = seeds, 0

    def begin(self, env: VectorEnv) -> None:
        """Episodes start in ``env``."""
        self.env, self.rng = env, np.random.default_rng([*self.seeds, self.batch])
        self.batch += 1

    def __call__(self, observations: Any) -> np.ndarray:
        """Actions float32 ``(n, action size)``."""
        low, high = (np.asarray(bound, np.float32) for bound in (self.env.task.action_low, self.env.task.action_high))
        drawn = self.rng.random((self.env.num_envs, len(low)), np.float32)
        return self.env.action_range.of_space(low + (high - low) * drawn)


class Scripted:
    """The task's scripted player; it sees the true factors, whatever the observation."""

    def begin(self, env: VectorEnv) -> None:
        """Episodes start in ``env``."""
        self.env = env

    def __call__(self, observations: Any) -> np.ndarray:
        """Actions float32 ``(n, action size)``; raises :class:`SegarError` if the task has no scripted player."""
        return self.env.action_range.of_space(self.env.task.scripted_actions(self.env.factors))
