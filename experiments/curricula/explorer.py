"""Trying levels out: whole episodes of the agent, from which it does not learn, and what the planner can do there."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
import torch
from torch import Tensor

from segar.envs import VectorEnv
from segar.experiments.collection.rewards import learner_reward
from segar.experiments.collection.saved_state import SavedState
from segar.experiments.curricula.episodes import MEANS, Ended
from segar.experiments.networks.encoders import successive
from segar.hardness import plan
from segar.levels import Levels

EXPLORING, PLANNING = 1, 2  # name the random streams


@dataclass(frozen=True, eq=False)
class Tried:
    """Episodes on levels that were tried: ``ended.row`` says on which; ``success`` is bool, one for each."""

    ended: Ended
    success: np.ndarray

    def success_rate(self, levels: int) -> np.ndarray:
        """The share of episodes that succeeded on each of so many levels, float64 ``(levels,)``."""
        return np.bincount(self.ended.row, self.success, levels) / np.bincount(self.ended.row, minlength=levels)


class Explorer(SavedState):
    """Plays levels side by side with the agent's present policy and sampled actions.

    Args:
        make_env: environments on levels, so many, of which nothing is reset by a step.
        batch: episodes that are played side by side.
        search: candidates and iterations of the planner.
        seed: of actions, of the randomness in rules, and of the planner.

    Attributes:
        agent: the PPO whose policy, rewards and discounts are used; set when it is there.
        steps: of all episodes so far; planned: episodes that the planner simulated so far.
    """

    saved = ("calls", "steps", "planned")

    def __init__(
        self, make_env: Callable[[Levels, int], VectorEnv], batch: int, search: tuple[int, int], seed: int
    ) -> None:
        self.make_env, self.batch, self.search, self.seed = make_env, batch, search, seed
        self.agent: Any = None
        self.env: VectorEnv | None = None
        self.calls = self.steps = self.planned = 0

    def try_levels(self, levels: Levels, episodes: int = 1) -> Tried:
        """So many episodes on each level."""
        level = np.repeat(np.arange(len(levels)), episodes)
        parts = [self._play(levels, level[k : k + self.batch]) for k in range(0, len(level), self.batch)]
        columns = {name: np.concatenate([getattr(one.ended, name) for one in parts]) for name in vars(parts[0].ended)}
        self.steps += int(columns["steps"].sum())
        return Tried(Ended(**columns), np.concatenate([one.success for one in parts]))

    def best_returns(self, levels: Levels) -> np.ndarray:
        """The return of the best episode on each level that the planner finds, float64; no step of it is the agent's."""
        samples, iterations = self.search
        rng = np.random.default_rng([self.seed, PLANNING, self._next()])
        found = plan(levels, self.agent.collector.env.task, rng=rng, samples=samples, iterations=iterations)
        self.planned += found.rollouts
        return found.returns

    def _next(self) -> int:
        self.calls += 1
        return self.calls

    @torch.no_grad()
    def _play(self, levels: Levels, level: np.ndarray) -> Tried:
        """One episode on each of these levels, of which there are at most ``batch``."""
        padded = np.concatenate([level, np.repeat(level[:1], self.batch - len(level))])
        if self.env is None:
            self.env = self.make_env(levels[padded], self.batch)
        else:
            self.env.replace_levels(np.arange(self.batch), levels[padded])
        env, policy, device = self.env, self.agent.policy, self.agent.device
        low, high = np.random.SeedSequence([self.seed, EXPLORING, self._next()]).generate_state(2, np.uint32).tolist()
        rng = torch.Generator().manual_seed(high)
        observation, _ = env.reset(seed=low, options={"levels": np.arange(self.batch)})
        memory = torch.zeros((self.batch, policy.memory_width), device=device)
        steps = []
        running, success = np.ones(self.batch, np.bool_), np.zeros(self.batch, np.bool_)
        with successive(policy):
            while running.any():
                loc, scale, value, memory = policy.step(torch.as_tensor(observation).to(device), memory)
                u = loc + scale * torch.randn(loc.shape, generator=rng).to(device)
                observation, reward, terminated, truncated, info = env.step(u.tanh().cpu().numpy())
                ends = terminated | truncated
                steps.append(
                    (value.cpu(), running, np.where(running, reward, 0.0).astype(np.float32), ends, terminated)
                )
                success = success | (running & info["success"])
                running = running & ~ends
            last = policy.step(torch.as_tensor(observation).to(device), memory)[2].cpu()
        values, played, *outcomes = zip(*steps, strict=True)
        mask = np.stack(played)[:, : len(level)]
        value, following = torch.stack(values), torch.stack([*values[1:], last])
        reward, done, dead = (torch.from_numpy(np.stack(one))[..., None] for one in outcomes)
        return Tried(self._ended(level, mask, value, following, reward, done, dead), success[: len(level)])

    def _ended(
        self, level: np.ndarray, mask: np.ndarray, value: Tensor, following: Tensor, reward: Tensor, done: Tensor,
        dead: Tensor,
    ) -> Ended:  # fmt: skip
        """What a rollout of whole episodes says of them; time first, [T, N, 1], and ``mask`` [T, n] of their steps."""
        config = self.agent.config
        learned = learner_reward(config, reward)
        if self.agent.scale is not None:
            learned = self.agent.scale.scaled(learned)
        gains, _ = self.agent.advantages(value, following, learned, done, dead)
        n, steps = len(level), mask.sum(axis=0)
        raw, returns, gain, values = (one[:, :n, 0].double().numpy() for one in (reward, learned, gains, value))
        discount = config.gamma ** np.arange(len(mask))[:, None]
        means = dict(zip(MEANS, (np.abs(gain), np.maximum(gain, 0.0), values), strict=True))
        return Ended(
            row=level,
            steps=steps,
            returns=raw.sum(axis=0),
            learned_return=(discount * returns * mask).sum(axis=0),
            **{name: (one * mask).sum(axis=0) / steps for name, one in means.items()},
        )
