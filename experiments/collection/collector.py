"""Collecting rollouts for PPO: every environment is stepped a number of times, and the steps are written into one storage.

From environments on a GPU, nothing is copied to the processor until the rollout is complete.
"""

from collections import deque
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
import torch
from gymnasium.spaces import Box
from torch import Tensor

from segar.envs import VectorEnv
from segar.experiments.collection.saved_state import as_tensors, from_tensors
from segar.experiments.networks.devices import require_one_device
from segar.experiments.networks.encoders import successive
from segar.experiments.settings import ConfigError
from segar.observations import copy_rows


def observation_shape(env: VectorEnv) -> tuple[int, ...]:
    """The shape of one observation; raises :class:`ConfigError` if an observation is not a single array."""
    space = env.single_observation_space
    if not isinstance(space, Box):
        raise ConfigError("observation: PPO reads one array, not a tuple or dict; choose one part, or stack it")
    return space.shape


def require_frames(algorithm: str, shape: tuple[int, ...]) -> None:
    """Raises :class:`ConfigError` unless observations of this shape are frames."""
    if len(shape) != 3:
        raise ConfigError(
            f"algorithm: {algorithm} reads frames, not observations of shape {list(shape)}; observation=rgb shows frames"
        )


def action_size(env: VectorEnv) -> int:
    """The number of components of an action."""
    shape = env.single_action_space.shape
    assert shape is not None  # a Box has one
    return shape[0]


class ActorCritic(Protocol):
    """A network that a collector reads: distributions of actions, values, and a memory, which may be empty."""

    memory_width: int

    def step(self, observation: Tensor, memory: Tensor) -> tuple[Tensor, Tensor, Tensor, Tensor]:
        """``loc``, ``scale`` [n, actions], the state's value [n, 1], and the memory [n, memory_width] afterwards."""
        ...


@dataclass
class Rollout:
    """The steps of one collection, time first: observation [T, N, ...]; ``u``, loc, scale [T, N, actions]; others [T, N, 1].

    A later collection overwrites it: with k storages, the k-th after it.
    """

    observation: Tensor
    u: Tensor  # pre-tanh actions
    loc: Tensor
    scale: Tensor
    value: Tensor
    # Of the next observation; where returns end by truncation, the value of the episode's last observation.
    next_value: Tensor
    reward: Tensor
    terminated: Tensor
    done: Tensor  # whether the episode ended
    level_done: Tensor  # whether it was the last one in a row on its level, so that the memory ends, too
    memory: Tensor  # [N, memory_width], of the policy before the first step


Collected = tuple[Rollout, dict[str, float]]  # and mean figures of the episodes that ended


class Storage:
    """Memory for one rollout: for what the policy reads and computes, and for what environments return.

    Args:
        size: numbers of steps and of environments.
        observation: observations of one step [N, ...], whose shape and dtype are taken.
        actions: number of components of an action.
        device: where policy and rollout live.
        place: where the environments run, and what they return is kept.
    """

    def __init__(
        self, size: tuple[int, int], observation: Tensor, actions: int, device: torch.device, place: torch.device
    ) -> None:
        steps, num_envs = size
        self.observation = torch.empty((steps, *observation.shape), dtype=observation.dtype, device=device)
        self.u, self.loc, self.scale = (torch.empty((*size, actions), device=device) for _ in range(3))
        self.value = torch.empty((steps + 1, num_envs, 1), device=device)
        self.reward = torch.empty(size, device=place)
        self.terminated, self.done, self.level_done = (
            torch.empty(size, dtype=torch.bool, device=place) for _ in range(3)
        )

    def rollout(self, next_value: Tensor, memory: Tensor) -> Rollout:
        """The content on the device, see :class:`Rollout`; only what environments returned is copied, and only to a GPU."""
        computed = {name: getattr(self, name) for name in ("observation", "u", "loc", "scale")}
        outcomes = {
            name: getattr(self, name)[..., None].to(self.value.device)
            for name in ("reward", "terminated", "done", "level_done")
        }
        return Rollout(**computed, **outcomes, value=self.value[:-1], next_value=next_value, memory=memory)


class RunningEpisodes:
    """What collectors keep between rollouts: environments, what was observed last, and what the policy remembers."""

    def __init__(
        self, env: VectorEnv, policy: ActorCritic, num_steps: int, device: torch.device, joins_trials: bool
    ) -> None:
        self.env: Any = env  # which takes and gives arrays, or tensors
        self.policy, self.num_steps, self.device, self.joins_trials = policy, num_steps, device, joins_trials
        self.current, _ = env.reset()
        self.memory = torch.zeros((env.num_envs, policy.memory_width), device=device)

    def restart(self) -> None:
        """Leaves the running episodes and begins others."""
        self.current, _ = self.env.reset()
        self.memory = torch.zeros_like(self.memory)

    def state_dict(self) -> dict[str, Any]:
        """The running episodes."""
        return {"env": as_tensors(self.env.state()), "memory": self.memory}

    def load_state_dict(self, state: Mapping[str, Any]) -> None:
        """Continues from ``state``."""
        self.current = self.env.restore(from_tensors(self.env.state(), state["env"]))
        self.memory = state["memory"].to(self.device)


class Collector(RunningEpisodes):
    """Steps environments with a policy and returns rollouts.

    Torch reads frames in the engine's own memory, and they are copied once, into the rollout. The means, deviations and values
    that the policy computes are written there, too, so that nothing is evaluated twice.

    Args:
        env: with ``autoreset_mode`` SAME_STEP; it may overwrite the arrays that it returned.
        policy: its actions are sampled.
        num_steps: of each environment, per collection.
        device: where policy and rollout live.
        joins_trials: whether returns go on over the trials of a level, so that only the last one's truncation is an end.
        storages: number of rollouts that are kept; each collection overwrites the oldest.
    """

    def __init__(
        self,
        env: VectorEnv,
        policy: ActorCritic,
        num_steps: int,
        device: torch.device,
        joins_trials: bool = False,
        storages: int = 1,
    ) -> None:
        super().__init__(env, policy, num_steps, device, joins_trials)
        frames = torch.from_numpy(self.current)
        # What lies in pinned memory goes to the GPU while the processor does something else.
        self.pinned = torch.empty(frames.shape, dtype=frames.dtype, pin_memory=True) if device.type == "cuda" else None
        size, actions = (num_steps, env.num_envs), action_size(env)
        self.storages = deque(Storage(size, frames, actions, device, frames.device) for _ in range(storages))

    def collect(self, rng: torch.Generator, more: bool = True) -> Collected:
        """The next rollout; ``rng`` draws the noise of actions. Only the asynchronous collector reads ``more``, whether
        another rollout will be collected."""
        return self.collect_with(self.draw_noise(rng))

    def draw_noise(self, rng: torch.Generator) -> Tensor:
        """The noise of one collection's actions; ``rng`` is a generator of the CPU, so that all devices get the same noise."""
        return torch.randn(self.storages[0].u.shape, generator=rng)

    @torch.no_grad()
    def collect_with(self, noise: Tensor) -> Collected:
        """Steps every environment ``num_steps`` times with this noise."""
        policy, first_memory, memory = self.policy, self.memory, self.memory
        storage = self.storages[0]
        self.storages.rotate(-1)
        outcomes = (storage.reward, storage.terminated, storage.done, storage.level_done)
        rewards, terminations, ends, level_ends = (one.numpy() for one in outcomes)
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
                np.logical_or(terminated, truncated, out=ends[t])
                rewards[t], terminations[t] = reward, terminated
                level_ends[t] = info.get("new_level", ends[t])
                if "_final_obs" in info:
                    ended.append(figures_at_end(info))
                    is_cut = truncated & level_ends[t] if self.joins_trials else truncated
                    if is_cut.any():
                        rows = np.flatnonzero(is_cut)
                        last = torch.from_numpy(info["final_obs"][rows]).to(self.device)
                        cut.append((t, rows, last, memory[torch.from_numpy(rows)]))
                    memory = memory * torch.from_numpy(~level_ends[t])[:, None].to(self.device)
            last = torch.from_numpy(np.ascontiguousarray(self.current))
            storage.value[-1] = policy.step(last.to(self.device), memory)[2]
        self.memory = memory
        return storage.rollout(self.bootstrap(storage.value, cut), first_memory), mean_figures(ended)

    def upload(self, place: Tensor) -> None:
        """Copies the current observations into a part of the rollout."""
        if self.device.type == "cpu":
            copy_rows(self.current, place.numpy())
        elif self.pinned is not None:
            copy_rows(self.current, self.pinned.numpy())
            place.copy_(self.pinned, non_blocking=True)
        else:
            place.copy_(torch.from_numpy(self.current))

    def bootstrap(self, value: Tensor, cut: list[tuple[int, np.ndarray, Tensor, Tensor]]) -> Tensor:
        """The values of the next observations [T, N, 1]; where returns end by truncation, the value of the last observation.

        Args:
            value: of all observations [T + 1, N, 1].
            cut: the episodes that were truncated there: time, environments, last observations, and the policy's memory there.
        """
        next_value = value[1:].clone()
        if cut:
            values = self.policy.step(torch.cat([last for _, _, last, _ in cut]), torch.cat([m for *_, m in cut]))[2]
            times = np.concatenate([np.full(len(rows), t) for t, rows, _, _ in cut])
            next_value[times, np.concatenate([rows for _, rows, _, _ in cut])] = values
        return next_value


class DeviceCollector(RunningEpisodes):
    """A :class:`Collector` of environments on a GPU, where policy and rollout live, too.

    Which episodes ended is known on the GPU alone until all steps are taken. The last observation of each environment is
    therefore kept for each step, and takes as much memory as the rollout.

    Args:
        env: with ``autoreset_mode`` SAME_STEP, on a GPU; it may overwrite the tensors that it returned.
        policy: its actions are sampled.
        num_steps: of each environment, per collection.
        device: where policy and rollout live; the environments' GPU.
        joins_trials: as of :class:`Collector`.

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


EPISODE_FIGURES = ("return", "length", "success", "death")


def figures_at_end(info: Mapping[str, Any]) -> dict[str, np.ndarray]:
    """The figures in a step's ``info`` of the episodes that ended with it, one entry for each episode."""
    final, rows = info["final_info"], info["_final_info"]
    ended = {key: final[key][rows] for key in EPISODE_FIGURES}
    return {key: part.cpu().numpy() if isinstance(part, Tensor) else part for key, part in ended.items()}


def mean_figures(ended: list[Mapping[str, np.ndarray]]) -> dict[str, float]:
    """Means over the episodes that ended (return, length, success, death), and their number."""
    ended = [one for one in ended if len(one["return"])]
    if not ended:
        return {"episode/count": 0.0}
    means = {f"episode/{key}": float(np.concatenate([one[key] for one in ended]).mean()) for key in EPISODE_FIGURES}
    return {**means, "episode/count": float(sum(len(one["return"]) for one in ended))}
