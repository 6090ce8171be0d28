"""What SAC and DrQ share: steps go into a replay, and a fixed number of gradient steps on samples of it follows each step.

A sub-class of :class:`OffPolicy` defines the policy and the loss.
"""

from abc import ABC, abstractmethod
from collections.abc import Mapping
from typing import Any

import numpy as np
import torch
from torch import Tensor, nn
from torch.optim.swa_utils import get_ema_multi_avg_fn

from segar.envs import VectorEnv
from segar.experiments.collection.collector import action_size, figures_at_end, mean_figures, observation_shape
from segar.experiments.collection.replay import Replay
from segar.experiments.collection.rewards import learner_reward
from segar.experiments.collection.saved_state import SavedState, as_tensors, from_tensors
from segar.experiments.networks.devices import require_one_device, usable_device


class OffPolicy(SavedState, ABC):
    """The learner, see :class:`segar.experiments.algorithms.learner.Learner`."""

    saved, parts = ("frames",), ("loss", "optimizer", "replay")

    def __init__(self, config: Any, env: VectorEnv, frames: int, seed: int) -> None:
        self.config, self.env, self.device = config, env, usable_device(config.device)
        require_one_device(self.device, env)
        self.rng = torch.Generator().manual_seed(seed)  # of the processor, so that devices draw alike
        self.shape, self.actions = observation_shape(env), action_size(env)
        self.policy: Any = self.make_policy(config, self.shape, self.actions)
        self.loss: Any = self.make_loss()
        weights = dict(self.loss.named_parameters())
        learned = [weight for weight in weights.values() if weight.requires_grad]
        self.optimizer = torch.optim.Adam(learned, lr=config.learning_rate, fused=True)
        self.targets = {name: weight for name, weight in weights.items() if name.startswith("target_")}
        self.sources = [weights[name.removeprefix("target_")] for name in self.targets]
        self.follow: Any = get_ema_multi_avg_fn(1 - config.tau)
        self.replay = Replay(config.capacity, config.num_envs, self.rng, self.device)
        self.frames = 0
        self.current, _ = env.reset()

    @staticmethod
    def make_env(levels: Any, num_envs: int, **options: Any) -> VectorEnv:
        """Environments that start the next episode by themselves."""
        return VectorEnv(levels, num_envs, true_factors=False, **options)

    @staticmethod
    @abstractmethod
    def make_policy(config: Any, observation_shape: tuple[int, ...], actions: int) -> nn.Module:
        """The network that acts: ``forward(observation)`` gives ``loc``, ``scale``, each [n, actions]."""

    @abstractmethod
    def make_loss(self) -> nn.Module:
        """Draws the weights of the policy and of all other networks; returns the loss that owns them. Those of a module called
        ``target_NAME`` follow those of ``NAME``."""

    def iterate(self) -> Mapping[str, float]:
        """Takes ``num_steps`` steps in every environment, each followed by its gradient steps; returns means of all figures."""
        ended: list[Mapping[str, np.ndarray]] = []
        updates: list[dict[str, Tensor]] = []
        for _ in range(self.config.num_steps):
            info = self.step()
            if "_final_info" in info:
                ended.append(figures_at_end(info))
            updates += [self.update() for _ in range(self.updates_due())]
        figures = {**mean_figures(ended), "updates": float(len(updates))}
        if updates:
            figures |= {name: float(torch.stack([u[name] for u in updates]).mean()) for name in updates[0]}
        return figures

    @torch.no_grad()
    def step(self) -> Mapping[str, Any]:
        """Steps every environment once and stores the step; returns the environments' ``info``."""
        before, noise_shape = self.current, (self.config.num_envs, self.actions)
        place = self.env.device  # of observations and actions
        if self.frames < self.config.warmup:  # uniform actions
            u = (2.0 * torch.rand(noise_shape, generator=self.rng) - 1.0).clamp(min=-NEAR_ONE).atanh().to(place)
        else:
            loc, scale = self.policy(torch.as_tensor(before).to(self.device))
            u = loc.to(place) + scale.to(place) * torch.randn(noise_shape, generator=self.rng).to(place)
        action = u.tanh()
        self.current, reward, terminated, truncated, info = self.env.step(
            action if self.env.runs_on_gpu else action.numpy()  # type: ignore[arg-type]
        )
        last = info.get("final_obs", self.current)
        reward, terminated, truncated = (torch.as_tensor(one)[:, None] for one in (reward, terminated, truncated))
        self.replay.add(
            torch.as_tensor(before), u, reward.float(), terminated, terminated | truncated, last=torch.as_tensor(last)
        )
        self.frames += len(u)
        return info

    def updates_due(self) -> int:
        """The number of gradient steps that follow the last step of the environments."""
        if self.frames < self.config.warmup:
            return 0
        per = self.config.steps_per_update
        return self.frames // per - (self.frames - self.config.num_envs) // per

    def update(self) -> dict[str, Tensor]:
        """One gradient step on all losses; returns their figures."""
        batch = self.replay.sample(self.config.batch_size)
        batch["next", "reward"] = learner_reward(self.config, batch["next", "reward"])
        figures = self.loss(batch)
        losses = {name: value for name, value in figures.items() if name.startswith("loss_")}
        self.optimizer.zero_grad()
        torch.stack(list(losses.values())).sum().backward()
        self.optimizer.step()
        self.follow(list(self.targets.values()), self.sources, None)
        return {LOGGED[name]: value.detach() for name, value in figures.items() if name in LOGGED}

    def state_dict(self) -> dict[str, Any]:
        """All networks with their targets, optimiser, replay, generator, counter and the running episodes."""
        return {**super().state_dict(), "rng": self.rng.get_state(), "env": as_tensors(self.env.state())}

    def load_state_dict(self, state: Mapping[str, Any]) -> None:
        """Continues from ``state``."""
        super().load_state_dict(state)
        self.rng.set_state(state["rng"])
        self.current = self.env.restore(from_tensors(self.env.state(), state["env"]))


NEAR_ONE = 1.0 - 2.0**-23  # -1 itself would be an infinite pre-tanh action

# What losses report under which name in metrics.
LOGGED = {
    "loss_actor": "loss/policy",
    "loss_qvalue": "loss/value",
    "alpha": "policy/temperature",
    "entropy": "policy/entropy",
}
