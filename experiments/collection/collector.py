"""Collecting for PPO: every environment is stepped a number of times, into one storage that lasts for the whole run."""

from __future__ import annotations

from collections import deque
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
import torch
from gymnasium.spaces import Box
from torch import Tensor

from experiments.collection.environment_state import as_tensors, from_tensors
from experiments.networks.encoders import successive
from experiments.settings import ConfigError
from segar.envs import VectorEnv
from segar.observations import copy_rows


def observation_shape(env: VectorEnv) -> tuple[int, ...]:
    """The shape of one observation; raises :class:`ConfigError` if it is not one array."""
    space = env.single_observation_space
    if not isinstance(space, Box):
        raise ConfigError("observation: PPO reads one array, not a tuple or dict; choose one part, or stack it")
    return space.shape


def action_size(env: VectorEnv) -> int:
    """How many numbers an action has."""
    shape = env.single_action_space.shape
    assert shape is not None  # a Box has one
    return shape[0]


class StepPolicy(Protocol):
    """What collects: a policy with values, and with a memory, which is empty for policies that have none."""

    memory_width: int

    def step(self, observation: Tensor, memory: Tensor) -> tuple[Tensor, Tensor, Tensor, Tensor]:
        """``loc``, ``scale`` [n, actions], the state's value [n, 1], and the memory [n, memory_width] afterwards."""
        ...


@dataclass
class Rollout:
    """What one collection saw, time first: observation [T, N, ...]; all others [T, N, 1] but ``u``, loc, scale [T, N, 2].

    A later collection writes over it: the next one, or as many later as the collector has storages.
    """

    observation: Tensor
    u: Tensor  # pre-tanh actions
    loc: Tensor
    scale: Tensor
    value: Tensor
    next_value: Tensor  # of the same episode: of its last observation where the episode was truncated
    reward: Tensor
    terminated: Tensor
    done: Tensor
    memory: Tensor  # [N, memory_width], of the policy before the first step


Collected = tuple[Rollout, dict[str, float]]  # and how episodes ended


class Storage:
    """Room for one rollout, on the device what the policy reads and computes, as arrays what environments say.

    Args:
        size: steps and environments.
        observation: those of one step [N, ...]; any of that shape and dtype.
        actions: numbers in an action.
    """

    def __init__(self, size: tuple[int, int], observation: Tensor, actions: int, device: torch.device) -> None:
        steps, num_envs = size
        self.observation = torch.empty((steps, *observation.shape), dtype=observation.dtype, device=device)
        self.u, self.loc, self.scale = (torch.empty((*size, actions), device=device) for _ in range(3))
        self.value = torch.empty((steps + 1, num_envs, 1), device=device)
        self.reward = np.empty(size, np.float32)
        self.terminated, self.done = np.empty(size, np.bool_), np.empty(size, np.bool_)

    def rollout(self, next_value: Tensor, memory: Tensor) -> Rollout:
        """What it holds, on the device; see :class:`Rollout`."""
        reward, terminated, done = (
            torch.from_numpy(array)[..., None].to(self.value.device)
            for array in (self.reward, self.terminated, self.done)
        )
        value = self.value[:-1]
        return Rollout(
            self.observation, self.u, self.loc, self.scale, value, next_value, reward, terminated, done, memory
        )


class Collector:
    """Environments at work for a policy; no step allocates or copies more than it must.

    Frames cross to torch in the engine's own memory, and are copied once, into the rollout. What the policy computes is
    written there, too, so that nothing is evaluated twice.

    Args:
        env: with ``autoreset_mode`` SAME_STEP; arrays that it returns may be its own.
        policy: its actions are sampled.
        num_steps: of each environment, per collection.
        device: where policy and rollout live.
        storages: rollouts that are kept; each collection writes over the oldest.
    """

    def __init__(
        self, env: VectorEnv, policy: StepPolicy, num_steps: int, device: torch.device, storages: int = 1
    ) -> None:
        self.env, self.policy, self.num_steps, self.device = env, policy, num_steps, device
        self.current, _ = env.reset()
        self.memory = torch.zeros((env.num_envs, policy.memory_width), device=device)
        frames = torch.from_numpy(self.current)
        # What lies in pinned memory goes to the GPU while the processor does something else.
        self.pinned = torch.empty(frames.shape, dtype=frames.dtype, pin_memory=True) if device.type == "cuda" else None
        size, actions = (num_steps, env.num_envs), action_size(env)
        self.storages = deque(Storage(size, frames, actions, device) for _ in range(storages))

    def collect(self, rng: torch.Generator, more: bool = True) -> Collected:
        """The next rollout; noise of actions comes from ``rng``. Whether ``more`` are wanted matters to who collects ahead."""
        return self.collect_with(self.draw_noise(rng))

    def draw_noise(self, rng: torch.Generator) -> Tensor:
        """The noise of one collection's actions; ``rng`` is of the CPU, so that devices draw alike."""
        return torch.randn(self.storages[0].u.shape, generator=rng)

    @torch.no_grad()
    def collect_with(self, noise: Tensor) -> Collected:
        """Steps every environment ``num_steps`` times; also says how episodes ended."""
        policy, first_memory, memory = self.policy, self.memory, self.memory
        storage = self.storages[0]
        self.storages.rotate(-1)
        noise = noise.to(self.device)
        ended: list[Mapping[str, np.ndarray]] = []
        cut: list[tuple[int, np.ndarray, Tensor, Tensor]] = []  # time, environments, last observations, memory
        with successive(policy):
            for t in range(self.num_steps):
                self.upload(storage.observation[t])
                loc, scale, value, memory = policy.step(storage.observation[t], memory)
                u = torch.add(loc, scale * noise[t], out=storage.u[t])
                storage.loc[t], storage.scale[t], storage.value[t] = loc, scale, value
                self.current, reward, terminated, truncated, info = self.env.step(u.tanh().cpu().numpy())
                np.logical_or(terminated, truncated, out=storage.done[t])
                storage.reward[t], storage.terminated[t] = reward, terminated
                if "_final_obs" in info:
                    ended.append(figures_at_end(info))
                    if truncated.any():
                        rows = np.flatnonzero(truncated)
                        last = torch.from_numpy(info["final_obs"][rows]).to(self.device)
                        cut.append((t, rows, last, memory[torch.from_numpy(rows)]))
                    memory = memory * torch.from_numpy(~storage.done[t])[:, None].to(self.device)
            last = torch.from_numpy(np.ascontiguousarray(self.current))
            storage.value[-1] = policy.step(last.to(self.device), memory)[2]
        self.memory = memory
        return storage.rollout(self.bootstrap(storage.value, cut), first_memory), mean_figures(ended)

    def upload(self, place: Tensor) -> None:
        """Copies the current observations to a place in the rollout."""
        if self.device.type == "cpu":
            copy_rows(self.current, place.numpy())
        elif self.pinned is not None:
            copy_rows(self.current, self.pinned.numpy())
            place.copy_(self.pinned, non_blocking=True)
        else:
            place.copy_(torch.from_numpy(self.current))

    def bootstrap(self, value: Tensor, cut: list[tuple[int, np.ndarray, Tensor, Tensor]]) -> Tensor:
        """The values that follow [T, N, 1]; where an episode was truncated, that of its last observation."""
        next_value = value[1:].clone()
        if cut:
            values = self.policy.step(torch.cat([last for _, _, last, _ in cut]), torch.cat([m for *_, m in cut]))[2]
            times = np.concatenate([np.full(len(rows), t) for t, rows, _, _ in cut])
            next_value[times, np.concatenate([rows for _, rows, _, _ in cut])] = values
        return next_value

    def state_dict(self) -> dict[str, Any]:
        """The running episodes."""
        return {"env": as_tensors(self.env.state()), "memory": self.memory}

    def load_state_dict(self, state: Mapping[str, Any]) -> None:
        """Goes on from ``state``."""
        self.current = self.env.restore(from_tensors(self.env.state(), state["env"]))
        self.memory = state["memory"].to(self.device)


EPISODE_FIGURES = ("return", "length", "success", "death")


def figures_at_end(info: Mapping[str, Any]) -> dict[str, np.ndarray]:
    """What a step's ``info`` says of the episodes that it ended, one entry each."""
    final, rows = info["final_info"], info["_final_info"]
    return {key: final[key][rows] for key in EPISODE_FIGURES}


def mean_figures(ended: list[Mapping[str, np.ndarray]]) -> dict[str, float]:
    """Means over the episodes that ended: return, length, success, death; and how many they were."""
    if not ended:
        return {"episode/count": 0.0}
    means = {f"episode/{key}": float(np.concatenate([one[key] for one in ended]).mean()) for key in EPISODE_FIGURES}
    return {**means, "episode/count": float(sum(len(one["return"]) for one in ended))}
