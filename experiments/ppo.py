"""Proximal policy optimisation (Schulman et al. 2017) on TorchRL's clipped loss and advantage; the loop is ours.

Each iteration: ``num_steps`` steps in every environment, advantages, then ``epochs`` passes over ``minibatches``.
A truncated episode bootstraps from the value of its last observation, a terminated one does not.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import torch
from tensordict import TensorDict
from tensordict.nn import ProbabilisticTensorDictModule, ProbabilisticTensorDictSequential, TensorDictModule
from torch import Tensor, nn
from torchrl.objectives import ClipPPOLoss
from torchrl.objectives.value.functional import generalized_advantage_estimate

from experiments.config import PPOConfig
from experiments.encoders import initialize, make_encoder
from experiments.errors import ConfigError, TrainingError
from experiments.policies import Actor, SquashedNormal, make_head
from experiments.snapshots import as_tensors, from_tensors
from segar.envs.torchrl_env import TorchRLEnv


class PPOPolicy(nn.Module):
    """Policy and value networks; ``shared`` says whether the value head reads the policy's representation."""

    def __init__(self, config: PPOConfig, observation_shape: tuple[int, ...], actions: int) -> None:
        super().__init__()
        self.shared = config.shared
        self.actor = Actor(config, observation_shape, actions)
        own = () if self.shared else (make_encoder(config, observation_shape),)
        self.value = nn.Sequential(*own, make_head(config, self.actor.encoder.width, 1))
        self.initial_log_std = math.log(config.initial_std)

    def initialize(self, rng: torch.Generator) -> None:
        """Draws all weights; the policy starts near the action 0 with the configured standard deviation."""
        initialize(self, rng)
        nn.init.constant_(self.actor.log_std[-1].bias, self.initial_log_std)  # type: ignore[arg-type]

    def forward(self, observation: Tensor) -> tuple[Tensor, Tensor, Tensor]:
        """``loc``, ``scale`` [n, actions] and the state's value [n, 1]."""
        loc, scale, hidden = self.actor(observation)
        return loc, scale, self.value(hidden if self.shared else observation)

    @torch.no_grad()
    def act(self, observation: np.ndarray, *, rng: torch.Generator | None) -> np.ndarray:
        """Actions float32 [n, actions]; sampled with ``rng``, deterministic where it is None."""
        loc, scale, _ = self.actor(torch.from_numpy(observation))
        u = loc if rng is None else loc + scale * torch.randn(loc.shape, generator=rng)
        return u.tanh().numpy()

    @torch.no_grad()
    def represent(self, observation: np.ndarray) -> np.ndarray:
        """The representation phi, float32 [n, width]."""
        return self.actor.encoder(torch.from_numpy(observation)).numpy()


@dataclass
class Rollout:
    """What one collection saw, time first: observation [T, N, ...]; all others [T, N, 1] but ``u``, loc, scale [T, N, 2]."""

    observation: Tensor
    u: Tensor  # pre-tanh actions
    loc: Tensor
    scale: Tensor
    value: Tensor
    next_value: Tensor  # of the same episode: of its last observation where the episode was truncated
    reward: Tensor
    terminated: Tensor
    done: Tensor


class PPO:
    """The learner, see :class:`experiments.learner.Learner`."""

    def __init__(self, config: PPOConfig, env: TorchRLEnv, frames: int, seed: int) -> None:
        self.config, self.env, self.budget = config, env, frames
        self.rng = torch.Generator().manual_seed(seed)
        if env.observation_key is None:
            raise ConfigError("observation: PPO reads one array, not a tuple or dict; choose one part, or stack it")
        shape, actions = env.observation_spec[env.observation_key].shape[1:], env.action_spec.shape[-1]
        self.policy = self.make_policy(config, tuple(shape), actions)
        self.policy.initialize(self.rng)
        self.loss = make_loss(config, self.policy)
        self.optimizer = torch.optim.Adam(
            self.policy.parameters(), lr=config.learning_rate, eps=config.adam_eps, fused=True
        )
        self.frames = 0
        self.current: Any = env.reset()

    @staticmethod
    def make_policy(config: PPOConfig, observation_shape: tuple[int, ...], actions: int) -> PPOPolicy:
        """The network without weights of its own."""
        return PPOPolicy(config, observation_shape, actions)

    def iterate(self) -> Mapping[str, float]:
        """Collects, estimates advantages, learns."""
        rollout, figures = self.collect()
        self.frames += rollout.reward.numel()
        return {**figures, **self.learn(rollout)}

    @torch.no_grad()
    def collect(self) -> tuple[Rollout, dict[str, float]]:
        """Steps every environment ``num_steps`` times with sampled actions."""
        steps, episodes = [], []
        for t in range(self.config.num_steps):
            observation = self.current.get(self.env.observation_key)
            loc, scale, value = self.policy(observation)
            u = loc + scale * torch.randn(loc.shape, generator=self.rng)
            after = self.env.step(TensorDict({"action": u.tanh()}, self.env.batch_size)).get("next")
            done = after.get("done")
            steps.append((observation, u, loc, scale, value, after.get("reward"), after.get("terminated"), done))
            self.current = after
            if done.any():
                episodes.append((t, after))
                self.current = self.env.reset(TensorDict({"_reset": done}, self.env.batch_size))
        observation, u, loc, scale, value, reward, terminated, done = map(torch.stack, zip(*steps, strict=True))
        last = self.policy(self.current.get(self.env.observation_key))[2]
        next_value = self.bootstrap(torch.cat([value[1:], last[None]]), episodes)
        rollout = Rollout(observation, u, loc, scale, value, next_value, reward, terminated, done)
        return rollout, episode_figures([after for _, after in episodes])

    def bootstrap(self, next_value: Tensor, episodes: list[tuple[int, Any]]) -> Tensor:
        """``next_value`` [T, N, 1] with the value of the last observation put in where an episode was truncated."""
        if not episodes:
            return next_value
        times = torch.tensor([t for t, _ in episodes])
        cut = torch.stack([after.get("truncated").squeeze(-1) for _, after in episodes])
        final = torch.stack([after.get(self.env.observation_key) for _, after in episodes])
        row, env = cut.nonzero(as_tuple=True)
        if len(row):
            next_value[times[row], env] = self.policy(final[row, env])[2]
        return next_value

    def learn(self, rollout: Rollout) -> dict[str, float]:
        """Takes ``epochs x minibatches`` gradient steps on a rollout; returns the mean of the losses' figures."""
        config = self.config
        batch = make_batch(config, rollout)
        rate = config.learning_rate * (max(1.0 - self.frames / self.budget, 0.0) if config.anneal else 1.0)
        for group in self.optimizer.param_groups:
            group["lr"] = rate
        totals: dict[str, Tensor] = {}
        for minibatch in self.minibatches(batch):
            figures = self.loss(minibatch)
            loss = torch.stack([value for name, value in figures.items() if name.startswith("loss_")]).sum()
            self.optimizer.zero_grad()
            loss.backward()
            norm = nn.utils.clip_grad_norm_(self.policy.parameters(), config.max_grad_norm)
            self.optimizer.step()
            for name, value in (*figures.items(), ("gradient_norm", norm)):
                totals[name] = totals.get(name, 0.0) + value.detach()
        updates = config.epochs * config.minibatches
        means = {LOGGED[name]: float(total) / updates for name, total in totals.items() if name in LOGGED}
        means["policy/std"] = float(rollout.scale.mean())
        check_finite(means, self.frames)
        return means

    def minibatches(self, batch: TensorDict) -> Iterator[TensorDict]:
        """Random disjoint parts of the batch, ``epochs`` times over."""
        for _ in range(self.config.epochs):
            for rows in torch.randperm(len(batch), generator=self.rng).tensor_split(self.config.minibatches):
                yield batch[rows]

    def state_dict(self) -> dict[str, Any]:
        """Optimiser, generator, frame counter and the running episodes; the weights are stored beside them."""
        return {
            "optimizer": self.optimizer.state_dict(),
            "rng": self.rng.get_state(),
            "frames": self.frames,
            "env": as_tensors(self.env.state()),
        }

    def load_state_dict(self, state: Mapping[str, Any]) -> None:
        """Goes on from ``state``."""
        self.optimizer.load_state_dict(state["optimizer"])
        self.rng.set_state(state["rng"])
        self.frames = state["frames"]
        self.current = self.env.restore(from_tensors(self.env.state(), state["env"]))


# What the loss reports under which name in metrics.
LOGGED = {
    "loss_objective": "loss/policy",
    "loss_critic": "loss/value",
    "entropy": "policy/entropy",
    "kl_approx": "policy/kl",
    "clip_fraction": "policy/clip_fraction",
    "gradient_norm": "loss/gradient_norm",
}


def make_loss(config: PPOConfig, policy: PPOPolicy) -> ClipPPOLoss:
    """TorchRL's clipped loss; with a shared encoder its critic is the value head alone, so the encoder runs once."""
    parts: list[Any] = [
        TensorDictModule(policy.actor, in_keys=["observation"], out_keys=["loc", "scale", "hidden"]),
        ProbabilisticTensorDictModule(
            in_keys=["loc", "scale"], out_keys=["u"], distribution_class=SquashedNormal, return_log_prob=True
        ),
    ]
    actor = ProbabilisticTensorDictSequential(*parts)
    source = "hidden" if config.shared else "observation"
    return ClipPPOLoss(
        actor,
        TensorDictModule(policy.value, in_keys=[source], out_keys=["state_value"]),
        clip_epsilon=config.clip,
        clip_value=config.clip_value,
        entropy_bonus=config.entropy_coef > 0,  # computing it for nothing would cost a fifth of the update
        entropy_coeff=config.entropy_coef,
        critic_coeff=0.5 * config.critic_coef,
        loss_critic_type="l2",
        normalize_advantage=True,
        log_explained_variance=False,
        functional=False,  # the parameters stay in the modules: half the overhead per call
    )


@torch.no_grad()
def make_batch(config: PPOConfig, rollout: Rollout) -> TensorDict:
    """The rollout with advantages and value targets, flattened to [T * N]."""
    advantage, target = generalized_advantage_estimate(
        config.gamma,
        config.gae_lambda,
        rollout.value,
        rollout.next_value,
        learner_reward(config, rollout.reward),
        rollout.done,
        rollout.terminated,
        time_dim=0,
    )
    log_prob = SquashedNormal(rollout.loc, rollout.scale).log_prob(rollout.u)
    entries = {
        "observation": rollout.observation,
        "u": rollout.u,
        "u_log_prob": log_prob,
        "state_value": rollout.value,
        "advantage": advantage,
        "value_target": target,
    }
    size = rollout.reward.numel()
    return TensorDict({key: value.flatten(0, 1) for key, value in entries.items()}, [size])


def learner_reward(config: PPOConfig, reward: Tensor) -> Tensor:
    """The reward that the learner sees; returns and evaluations always count the task's own."""
    if config.reward_transform == "sqrt":
        # Near the goal -d^2 is almost flat, and a death of -100 swamps all else; the root mends both.
        reward = reward.sign() * reward.abs().sqrt()
    return reward * config.reward_scale


def episode_figures(ended: list[Any]) -> dict[str, float]:
    """Means over the episodes that ended: return, length, success, death; and how many they were."""
    if not ended:
        return {"episode/count": 0.0}
    masks = [after.get("done") for after in ended]
    means = {
        f"episode/{key}": float(
            torch.cat([after.get(key)[m] for after, m in zip(ended, masks, strict=True)]).double().mean()
        )
        for key in ("return", "length", "success", "death")
    }
    return {**means, "episode/count": float(sum(int(m.sum()) for m in masks))}


def check_finite(figures: Mapping[str, float], frames: int) -> None:
    """Raises :class:`TrainingError` that names the first figure that is not finite."""
    for name, value in figures.items():
        if not math.isfinite(value):
            raise TrainingError(f"{name} became {value} after {frames} frames; lower algorithm.learning_rate")
