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
    RunningEpisodes,
    Storage,
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
        super().__init__(env, policy, num_steps, env.device, joins_trials)
        size = (num_steps, env.num_envs)
        self.storage = Storage(size, self.current, action_size(env), env.device, env.device)
        self.last, self.truncated = torch.empty_like(self.storage.observation), torch.empty_like(self.storage.done)
        self.remembered = torch.empty((*size, policy.memory_width), device=env.device)

    @torch.no_grad()
    def collect(self, rng: torch.Generator, more: bool = True) -> Collected:
        """The next rollout, which overwrites the last one; ``rng`` draws the noise of actions on the processor."""
        policy, storage, first_memory = self.policy, self.storage, self.memory
        noise = torch.randn(storage.u.shape, generator=rng).to(self.device)
        memory: Any = first_memory
        figures: list[Mapping[str, Tensor]] = []
        with successive(policy):
            for t in range(self.num_steps):
                storage.observation[t] = self.current
                loc, scale, value, memory = policy.step(storage.observation[t], memory)
                u = torch.add(loc, scale * noise[t], out=storage.u[t])
                storage.loc[t], storage.scale[t], storage.value[t] = loc, scale, value
                self.current, reward, terminated, self.truncated[t], info = self.env.step(u.tanh())
                storage.reward[t], storage.terminated[t] = reward, terminated
                storage.done[t] = terminated | self.truncated[t]
                storage.level_done[t] = info.get("new_level", storage.done[t])
                self.last[t], self.remembered[t] = info["final_obs"], memory
                figures.append({key: info["final_info"][key] for key in EPISODE_FIGURES})
                memory = memory * ~storage.level_done[t][:, None]
            storage.value[-1] = policy.step(self.current, memory)[2]
        self.memory = memory
        ended = {key: torch.stack([one[key] for one in figures])[storage.done].cpu().numpy() for key in EPISODE_FIGURES}
        return storage.rollout(self._bootstrap(storage), first_memory), mean_figures([ended])

    def _bootstrap(self, storage: Storage) -> Tensor:
        """The values of the next observations [T, N, 1]; where returns end by truncation, the value of the last observation."""
        next_value = storage.value[1:].clone()
        is_cut = self.truncated & storage.level_done if self.joins_trials else self.truncated
        if is_cut.any():
            next_value[is_cut] = self.policy.step(self.last[is_cut], self.remembered[is_cut])[2]
        return next_value
