"""Phasic policy gradient (Cobbe et al. 2021): policy and value have networks of their own, and share what they learn in phases.

A *policy phase* is PPO on N_pi rollouts, with a policy network and a value network that have no weight in common. The
*auxiliary phase* after it trains on all of these rollouts once more: an additional value head on the policy network, which
is thereby taught what the value depends on, and the value network. In several epochs it minimises

    L_aux + beta_clone KL[pi_old || pi] + L_value

where L_aux and L_value are half the squared errors of the two values from the targets of the policy phase, and pi_old is the
policy at the end of that phase, which is to act as before. Both networks have one Adam in this phase, apart from PPO's.

One call of :meth:`PPG.iterate` is a policy phase and its auxiliary phase, so a checkpoint holds no rollouts. They are kept in
memory until then: a rollout of 64 environments and 32 steps takes 50 MB where two frames of 64 x 64 pixels are observed. As
in the authors' code, no auxiliary phase follows the rollouts that are left when the budget ends.
"""

from collections.abc import Mapping, Sequence
from typing import Any

import torch
from tensordict import TensorDict
from torch import Tensor, nn
from torch.distributions import kl_divergence

from segar.envs import VectorEnv
from segar.experiments.algorithms.ppo import PPO, PPOPolicy, random_parts
from segar.experiments.collection.collector import Rollout
from segar.experiments.networks.policies import SquashedNormal, make_head
from segar.experiments.settings import ConfigError, PPGConfig


class PPGPolicy(PPOPolicy):
    """PPO's two networks, and a value head on the policy's, which no action depends on."""

    def __init__(self, config: PPGConfig, observation_shape: tuple[int, ...], actions: int) -> None:
        super().__init__(config, observation_shape, actions)
        self.auxiliary = make_head(config, self.actor.encoder.width, 1)

    def both(self, observation: Tensor) -> tuple[Tensor, Tensor, Tensor, Tensor]:
        """``loc``, ``scale`` [n, actions], and the value [n, 1] by the policy network's head and by the value network."""
        loc, scale, hidden = self.actor(observation)
        return loc, scale, self.auxiliary(hidden), self.value(observation)


class PPG(PPO):
    """The learner, see :class:`segar.experiments.algorithms.learner.Learner`."""

    config: PPGConfig
    parts = (*PPO.parts, "auxiliary_optimizer")
    make_policy = PPGPolicy

    def __init__(self, config: PPGConfig, env: VectorEnv, frames: int, seed: int) -> None:
        size = config.num_envs * config.num_steps
        if frames < config.phase * size:
            raise ConfigError(
                f"algorithm.phase: {config.phase} rollouts of {size} frames are more than the budget, {frames}, so that there"
                " would be no auxiliary phase; lower algorithm.phase, or raise scale.frames"
            )
        super().__init__(config, env, frames, seed)
        rate = config.auxiliary_learning_rate
        self.auxiliary_optimizer = torch.optim.Adam(self.policy.parameters(), lr=rate, eps=config.adam_eps, fused=True)
        self.phase: list[TensorDict] = []  # of the rollouts since the last auxiliary phase: what that phase needs

    def iterate(self) -> Mapping[str, float]:
        """A policy phase, or what is left of the budget, and an auxiliary phase; returns the means of their figures."""
        size = self.config.num_envs * self.config.num_steps
        rollouts = min(self.config.phase, -(-(self.budget - self.frames) // size))
        figures = mean_of_rollouts([super(PPG, self).iterate() for _ in range(max(rollouts, 1))])
        if len(self.phase) == self.config.phase:
            figures |= self.learn_auxiliary()
        self.phase.clear()
        return figures

    def make_batch(self, rollout: Rollout) -> TensorDict:
        """PPO's batch; what the auxiliary phase needs of the rollout is kept."""
        batch = super().make_batch(rollout)
        kept = {
            "observation": rollout.observation.clone(),
            "done": rollout.done.clone(),
            "value_target": batch["value_target"],
        }
        self.phase.append(TensorDict(kept, batch.shape))
        return batch

    def learn_auxiliary(self) -> dict[str, float]:
        """Takes the gradient steps of an auxiliary phase; returns the means of the last epoch's losses."""
        config = self.config
        batch = self.auxiliary_batch()
        parts = config.phase * config.auxiliary_minibatches
        self.set_rate(self.auxiliary_optimizer, config.auxiliary_learning_rate)
        totals = torch.zeros(3, device=self.device)
        for _ in range(config.auxiliary_epochs):
            totals.zero_()
            for minibatch in random_parts(batch, config.steps_together, parts, self.rng):
                losses = auxiliary_losses(self.policy, minibatch)
                clone, *values = losses
                self.auxiliary_optimizer.zero_grad()
                (config.clone_coef * clone + sum(values)).backward()
                nn.utils.clip_grad_norm_(self.policy.parameters(), config.max_grad_norm)
                self.auxiliary_optimizer.step()
                totals += torch.stack(losses).detach()
        names = ("policy_kl", "value_of_policy", "value")
        return {f"auxiliary/{name}": total / parts for name, total in zip(names, totals.tolist(), strict=True)}

    @torch.no_grad()
    def auxiliary_batch(self) -> TensorDict:
        """All steps of the phase, one rollout after the other, with the policy that acts at its end."""
        batch: Any = TensorDict.cat(self.phase)
        batch["observation"] = self.policy.prepare(batch["observation"], batch.pop("done"))
        acting = [self.policy.actor(observation)[:2] for observation in batch["observation"].unbind()]
        batch["loc"], batch["scale"] = (torch.stack(parts) for parts in zip(*acting, strict=True))
        return batch


def auxiliary_losses(policy: PPGPolicy, minibatch: TensorDict) -> list[Tensor]:
    """The KL [nats] from the policy of ``loc`` and ``scale``, and half the squared errors of the values by the policy network
    and by the value network; means over steps."""
    loc, scale, *values = policy.both(minibatch["observation"])
    old = SquashedNormal(minibatch["loc"], minibatch["scale"])
    clone = kl_divergence(old, SquashedNormal(loc, scale)).mean()
    return [clone, *(0.5 * (value - minibatch["value_target"]).square().mean() for value in values)]


def mean_of_rollouts(figures: Sequence[Mapping[str, float]]) -> dict[str, float]:
    """The means of figures of several rollouts; those of episodes are means over episodes, whose number is a sum."""
    counts = [one["episode/count"] for one in figures]
    found = {"episode/count": sum(counts)}
    for name in dict.fromkeys(name for one in figures for name in one if name != "episode/count"):
        weights = counts if name.startswith("episode/") else [1.0] * len(counts)
        known = [(one[name], weight) for one, weight in zip(figures, weights, strict=True) if name in one]
        found[name] = sum(value * weight for value, weight in known) / sum(weight for _, weight in known)
    return found
