"""Collecting rollouts from environments on a GPU: nothing is copied to the processor until the rollout is complete."""

from collections.abc import Mapping
from typing import Any

import torch
from torch import Tensor

from segar.envs import VectorEnv
from segar.experiments.collection.collector import (
    EPISODE_FIGURES,
    ActorCritic,
    Collected,
    Rollout,
    RunningEpisodes,
    action_size,
    mean_figures,
)
from segar.experiments.networks.devices import require_one_device
from segar.experiments.networks.encoders import successive


class DeviceCollector(RunningEpisodes):
    """A :class:`segar.experiments.collection.collector.Collector` of environments on a GPU, where policy and rollout live, too.

    Which episodes ended is known on the GPU alone until all steps are taken. The last observation of each environment is
    therefore kept for each step, and takes as much memory as the rollout.

    Args:
        env: with ``autoreset_mode`` SAME_STEP, on a GPU; it may overwrite the tensors that it returned.
        policy: its actions are sampled.
        num_steps: of each environment, per collection.
        device: where policy and rollout live; the environments' GPU.
        joins_trials: as of :class:`segar.experiments.collection.collector.Collector`.

    Raises:
        ConfigError: policy and environments are on different devices.
    """

    def __init__(
        self, env: VectorEnv, policy: ActorCritic, num_steps: int, device: torch.device, joins_trials: bool = False
    ) -> None:
        require_one_device(device, env)
        self.joins_trials = joins_trials
        self.env: Any = env  # which takes and gives tensors, not arrays
        self.policy, self.num_steps, self.device = policy, num_steps, env.device
        self.current, _ = env.reset()
        self.memory: Tensor = torch.zeros((env.num_envs, policy.memory_width), device=self.device)
        size, actions = (num_steps, env.num_envs), action_size(env)
        self.observation, self.last = (
            self._new((num_steps, *self.current.shape), self.current.dtype) for _ in range(2)
        )
        self.u, self.loc, self.scale = (self._new((*size, actions)) for _ in range(3))
        self.value, self.reward = self._new((num_steps + 1, env.num_envs, 1)), self._new(size)
        self.terminated, self.truncated, self.level_done = (self._new(size, torch.bool) for _ in range(3))
        self.remembered = self._new((*size, policy.memory_width))

    def _new(self, shape: tuple[int, ...], dtype: torch.dtype = torch.float32) -> Tensor:
        return torch.empty(shape, dtype=dtype, device=self.device)

    @torch.no_grad()
    def collect(self, rng: torch.Generator, more: bool = True) -> Collected:
        """The next rollout, which overwrites the last one; ``rng`` draws the noise of actions on the processor."""
        noise = torch.randn(self.u.shape, generator=rng).to(self.device)
        policy, first_memory = self.policy, self.memory
        memory: Any = first_memory
        figures: list[Mapping[str, Tensor]] = []
        with successive(policy):
            for t in range(self.num_steps):
                self.observation[t] = self.current
                loc, scale, value, memory = policy.step(self.observation[t], memory)
                u = torch.add(loc, scale * noise[t], out=self.u[t])
                self.loc[t], self.scale[t], self.value[t] = loc, scale, value
                self.current, reward, terminated, truncated, info = self.env.step(u.tanh())
                self.reward[t], self.terminated[t], self.truncated[t] = reward, terminated, truncated
                self.last[t], self.remembered[t] = info["final_obs"], memory
                figures.append({key: info["final_info"][key] for key in EPISODE_FIGURES})
                self.level_done[t] = info.get("new_level", terminated | truncated)
                memory = memory * ~self.level_done[t][:, None]
            self.value[-1] = policy.step(self.current, memory)[2]
        self.memory = memory
        done = self.terminated | self.truncated
        rollout = Rollout(
            self.observation, self.u, self.loc, self.scale, self.value[:-1], self._bootstrap(), self.reward[..., None],
            self.terminated[..., None], done[..., None], self.level_done[..., None], first_memory,
        )  # fmt: skip
        ended = {key: torch.stack([one[key] for one in figures])[done].cpu().numpy() for key in EPISODE_FIGURES}
        return rollout, mean_figures([ended])

    def _bootstrap(self) -> Tensor:
        """The values of the next observations [T, N, 1]; where returns end by truncation, the value of the last observation."""
        next_value = self.value[1:].clone()
        is_cut = self.truncated & self.level_done if self.joins_trials else self.truncated
        if is_cut.any():
            next_value[is_cut] = self.policy.step(self.last[is_cut], self.remembered[is_cut])[2]
        return next_value
