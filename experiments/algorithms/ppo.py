"""Proximal policy optimisation (Schulman et al. 2017), on TorchRL's advantage estimate.

    segar train algorithm=ppo_fast observation=state levels=objectsx1-easy levels.count=100 \\
        scale.frames=200_000 evaluation.interval=50_000

Its curve (training seed 0, 100 test levels, deterministic actions):

    frames               51,200  100,352  151,552  200,704
    return on test        -1.30    -0.85    -0.50    -0.39
    success on test        0.18     0.42     0.68     0.82

Read from :meth:`PPO.iterate` downwards: each iteration collects ``num_steps`` steps in every environment, estimates
advantages, and takes ``epochs`` passes over ``minibatches``. A truncated episode bootstraps from the value of its last
observation (:meth:`segar.experiments.collection.collector.Collector.bootstrap`), a terminated one from 0. Where returns go on
over the trials of a level (:class:`segar.experiments.algorithms.recurrent_ppo.RecurrentPPO`), this holds for the last trial
alone: all others bootstrap from the value of the next trial's first observation.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping
from typing import Any, ClassVar

import numpy as np
import torch
from tensordict import TensorDict, TensorDictBase
from torch import Tensor, nn
from torch._dynamo.exc import BackendCompilerFailed
from torch.nn import functional as F
from torchrl.objectives.value.functional import generalized_advantage_estimate

from segar.envs import VectorEnv
from segar.experiments.collection.async_collector import AsyncCollector
from segar.experiments.collection.collector import (
    Collected,
    Collector,
    DeviceCollector,
    Rollout,
    action_size,
    observation_shape,
)
from segar.experiments.collection.rewards import ReturnScale, learner_reward
from segar.experiments.collection.saved_state import SavedState
from segar.experiments.networks.devices import usable_device
from segar.experiments.networks.encoders import FrameEncoder, initialize, make_encoder
from segar.experiments.networks.policies import Actor, SquashedNormal, actions_of, make_head, representation_of
from segar.experiments.settings import PPOConfig, TrainingError
from segar.levels import Levels

LEAST_DEVIATION = 1e-6  # of advantages
# Figures of the loss, and their names in the metrics.
LOGGED = {
    "loss_objective": "loss/policy",
    "loss_critic": "loss/value",
    "entropy": "policy/entropy",
    "kl_approx": "policy/kl",
    "clip_fraction": "policy/clip_fraction",
    "gradient_norm": "loss/gradient_norm",
}


class PPO(SavedState):
    """The learner, see :class:`segar.experiments.algorithms.learner.Learner`."""

    saved, parts = ("frames",), ("optimizer", "scale")
    logged: ClassVar[Mapping[str, str]] = LOGGED

    def __init__(self, config: PPOConfig, env: VectorEnv, frames: int, seed: int) -> None:
        self.config, self.budget = config, frames
        self.device = usable_device(config.device)
        # Whether returns go on over the trials of a level; a policy without a memory gains nothing in later ones.
        self.joins_trials: bool = getattr(config, "joins_trials", False)
        self.rng = torch.Generator().manual_seed(seed)
        self.policy: Any = self.make_policy(config, observation_shape(env), action_size(env))
        self.policy.initialize(self.rng)
        self.policy.to(self.device)
        collector = DeviceCollector if env.runs_on_gpu else AsyncCollector if config.overlap else Collector
        self.collector: Any = collector(env, self.policy, config.num_steps, self.device, self.joins_trials)
        self.figures = compiled(self.losses) if config.compile else self.losses
        self.optimizer = torch.optim.Adam(
            self.policy.parameters(), lr=config.learning_rate, eps=config.adam_eps, fused=True
        )
        self.scale = ReturnScale(env.num_envs, config.gamma) if config.reward_normalise else None
        self.frames = 0
        # Called with each rollout, its rewards as they are learned from and its advantages [T, N, 1]; for curricula.
        self.listen: Callable[[Rollout, Tensor, Tensor], None] | None = None

    @staticmethod
    def make_env(levels: Levels, num_envs: int, **options: Any) -> VectorEnv:
        """Environments that start the next episode by themselves, and whose arrays are overwritten by the next step."""
        return VectorEnv(levels, num_envs, copy=False, true_factors=False, **options)

    @staticmethod
    def make_policy(config: Any, observation_shape: tuple[int, ...], actions: int) -> Any:
        """The policy's network; its weights are to be drawn or loaded."""
        return PPOPolicy(config, observation_shape, actions)

    def iterate(self) -> Mapping[str, float]:
        """Collects a rollout and learns from it; returns figures of the episodes that ended and of the losses."""
        rollout, figures = self.collect()
        return {**figures, **self.learn(rollout)}

    def collect(self) -> Collected:
        """A rollout of ``num_steps`` steps in every environment, and figures of the episodes that ended."""
        size = self.config.num_envs * self.config.num_steps
        collected = self.collector.collect(self.rng, more=self.frames + size < self.budget)
        self.frames += size
        return collected

    def learn(self, rollout: Rollout) -> dict[str, float]:
        """Takes ``epochs x minibatches`` gradient steps on a rollout; returns the means of the losses' figures."""
        config = self.config
        batch = self.make_batch(rollout)
        self.set_rate(self.optimizer, config.learning_rate)
        totals, weights = dict[str, Tensor](), list(self.policy.parameters())
        for minibatch in self.minibatches(batch):
            figures = self.figures(minibatch)
            loss = torch.stack([value for name, value in figures.items() if name.startswith("loss_")]).sum()
            self.optimizer.zero_grad()
            loss.backward()
            norm = nn.utils.clip_grad_norm_(weights, config.max_grad_norm)
            self.optimizer.step()
            for name, value in (*figures.items(), ("gradient_norm", norm)):
                totals[name] = totals.get(name, 0.0) + value.detach()
        updates = config.epochs * config.minibatches
        means = {self.logged[name]: float(total) / updates for name, total in totals.items() if name in self.logged}
        return {**means, "policy/std": float(rollout.scale.mean())}

    def set_rate(self, optimizer: torch.optim.Optimizer, rate: float) -> None:
        """Sets the learning rate of an optimiser, which falls to 0 with the frames where the settings say so."""
        rate *= max(1.0 - self.frames / self.budget, 0.0) if self.config.anneal else 1.0
        for group in optimizer.param_groups:
            group["lr"] = rate

    @torch.no_grad()
    def make_batch(self, rollout: Rollout) -> TensorDict:
        """The rollout with advantages and value targets, [T, N], as the loss reads it."""
        config = self.config
        reward = learner_reward(config, rollout.reward)
        ends = rollout.level_done if self.joins_trials else rollout.done
        if self.scale is not None:
            reward = self.scale(reward, ends)
        dead = rollout.terminated & ends
        advantage, target = self.advantages(rollout.value, rollout.next_value, reward, ends, dead)
        if self.listen is not None:
            self.listen(rollout, reward, advantage)
        entries = {
            "observation": self.policy.prepare(rollout.observation, rollout.done),
            "u": rollout.u,
            "u_log_prob": SquashedNormal(rollout.loc, rollout.scale).log_prob(rollout.u),
            "state_value": rollout.value,
            "advantage": advantage,
            "value_target": target,
        }
        return TensorDict(entries, rollout.reward.shape[:2])

    def advantages(
        self, value: Tensor, next_value: Tensor, reward: Tensor, ends: Tensor, dead: Tensor
    ) -> tuple[Tensor, Tensor]:
        """Advantages and value targets of steps whose rewards are as they are learned from; all [T, N, 1].

        Returns end where ``ends``, and where they end, the next value counts but for the ``dead``.
        """
        gamma, gae_lambda = self.config.gamma, self.config.gae_lambda
        return generalized_advantage_estimate(gamma, gae_lambda, value, next_value, reward, ends, dead, time_dim=0)

    def minibatches(self, batch: TensorDict) -> Iterator[TensorDict]:
        """Random disjoint parts of the steps in a batch [T, N], ``epochs`` times over; ``steps_together`` successive steps of
        an environment stay together."""
        for _ in range(self.config.epochs):
            yield from random_parts(batch, self.config.steps_together, self.config.minibatches, self.rng)

    def losses(self, minibatch: TensorDict) -> dict[str, Tensor]:
        """The loss's figures; those named ``loss_...`` add up to what is minimised."""
        return clipped_loss(self.config, minibatch, *self.policy(minibatch["observation"]))

    def state_dict(self) -> dict[str, Any]:
        """Optimiser, generator, frame counter and the running episodes; the weights are stored beside them."""
        return {**super().state_dict(), **self.collector.state_dict(), "rng": self.rng.get_state()}

    def load_state_dict(self, state: Mapping[str, Any]) -> None:
        """Continues from ``state``."""
        super().load_state_dict(state)
        self.collector.load_state_dict(state)
        self.rng.set_state(state["rng"])


class PPOPolicy(nn.Module):
    """Policy and value networks; where they are ``shared``, the value head reads the policy's representation."""

    memory_width = 0

    def __init__(self, config: PPOConfig, observation_shape: tuple[int, ...], actions: int) -> None:
        super().__init__()
        # Where the configuration leaves it open, policy and value share a CNN, but no MLP.
        self.shared = len(observation_shape) == 3 if config.shared is None else config.shared
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

    def step(self, observation: Tensor, memory: Tensor) -> tuple[Tensor, Tensor, Tensor, Tensor]:
        """See :class:`segar.experiments.collection.collector.ActorCritic`; there is no memory."""
        return (*self(observation), memory)

    def prepare(self, observation: Tensor, done: Tensor) -> Tensor:
        """A rollout's observations [T, N, ...] in the form in which the networks read them several times."""
        for part in self.value.children():  # an encoder of its own reads the same
            if isinstance(part, FrameEncoder):
                part.prepare(observation, done)
        return self.actor.encoder.prepare(observation, done)

    def act(self, observation: np.ndarray, *, rng: torch.Generator | None) -> np.ndarray:
        """Actions float32 [n, actions]; sampled with ``rng``, deterministic where it is None."""
        return actions_of(self.actor, observation, rng)

    def represent(self, observation: np.ndarray) -> np.ndarray:
        """The representation phi, float32 [n, width]."""
        return representation_of(self.actor.encoder, observation)


def random_parts(batch: TensorDict, together: int, parts: int, rng: torch.Generator) -> Iterator[TensorDict]:
    """Random disjoint ``parts`` of the steps in a batch [T, N], all of them once; ``together`` successive steps of an
    environment stay together."""
    flat: Any = batch.flatten()
    device = flat.device or next(iter(flat.values())).device
    steps = torch.arange(len(flat), device=device).view(-1, together, batch.shape[1]).transpose(1, 2)
    pieces = steps.flatten(0, 1)  # [pieces, together]
    order = torch.randperm(len(pieces), generator=rng).to(device)
    for chosen in order.tensor_split(parts):
        rows = pieces[chosen].flatten()
        # As batch[rows], whose indexing takes four times as long for frames.
        chosen_rows = {key: value.index_select(0, rows) for key, value in flat.items()}
        yield TensorDict._new_unsafe(chosen_rows, batch_size=rows.shape)


def clipped_loss(
    config: PPOConfig, minibatch: TensorDictBase, loc: Tensor, scale: Tensor, value: Tensor
) -> dict[str, Tensor]:
    """The clipped loss with a minibatch's advantages normalised, and what tells of the policy's change.

    TorchRL's, whose bits these are, takes as long as the networks (docs/decisions/0040-where-training-loses-its-time.md).

    Args:
        loc, scale, value: of the policy, at the minibatch's observations.
    """
    law, advantage = SquashedNormal(loc, scale), minibatch["advantage"]
    advantage = (advantage - advantage.mean()) / advantage.std().clamp_min(LEAST_DEVIATION)
    change = (law.log_prob(minibatch["u"]) - minibatch["u_log_prob"])[..., None]
    clipped = change.clamp(math.log1p(-config.clip), math.log1p(config.clip))
    gain = torch.stack([change.exp() * advantage, clipped.exp() * advantage], -1).min(-1).values
    error = F.mse_loss(minibatch["value_target"], value, reduction="none")
    if config.clip_value is not None:
        before = minibatch["state_value"]
        near = before + (value - before).clamp(-config.clip_value, config.clip_value)
        error = torch.maximum(error, F.mse_loss(minibatch["value_target"], near, reduction="none"))
    figures = {
        "loss_objective": -gain.mean(),
        "loss_critic": (0.5 * config.critic_coef * error).mean(),
        "kl_approx": -change.detach().mean(),
        "clip_fraction": (clipped != change).to(change.dtype).mean(),
    }
    if config.entropy_coef > 0:
        entropy = law.entropy()
        figures |= {"entropy": entropy.detach().mean(), "loss_entropy": (-config.entropy_coef * entropy).mean()}
    return figures


def compiled(function: Callable[[TensorDict], dict[str, Tensor]]) -> Callable[[TensorDict], dict[str, Tensor]]:
    """The function by torch.compile; on a GPU it is replayed as CUDA graphs. Raises :class:`TrainingError` where torch cannot
    compile it."""
    fast = torch.compile(function, mode="reduce-overhead", dynamic=False)

    def call(minibatch: TensorDict) -> dict[str, Tensor]:
        try:
            return fast(minibatch)
        except BackendCompilerFailed as error:
            reason = " ".join(str(error).split("\n")[:2]).strip()
            raise TrainingError(
                f"algorithm.compile: torch cannot compile the loss ({reason}). It needs a C++ compiler, on a GPU Triton; "
                "algorithm.compile=false does without"
            ) from error

    return call
