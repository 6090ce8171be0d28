"""The protocol of algorithms: a learner collects and learns by iterations, and owns a policy that acts.

An algorithm of your own is three things: a frozen sub-class of :class:`segar.experiments.settings.config.AlgorithmConfig` with
its settings, whose ``learner`` names a class as ``module:Class``; that class, which has the members of :class:`Learner`; and a
YAML in ``conf/algorithm/`` that names the settings. :class:`segar.experiments.algorithms.ppo.PPO` is one to start from.
"""

from collections.abc import Mapping
from typing import Any, Protocol

import numpy as np
import torch
from torch import nn

from segar.envs import VectorEnv
from segar.experiments.settings import AlgorithmConfig, class_behind, require_members


class PolicyNetwork(Protocol):
    """A network that acts. It is an ``nn.Module``, so that checkpoints can hold its weights; evaluation makes it a
    :class:`segar.envs.Policy`.

    A network with a memory, or one that must know more than it observes, also has a method ``begin(env)``: evaluation calls
    it when the episodes of a batch start in a :class:`segar.envs.VectorEnv`.
    """

    def act(self, observation: np.ndarray, *, rng: torch.Generator | None) -> np.ndarray:
        """Actions float32 [n, actions] for observations [n, ...]; sampled with ``rng``, deterministic where it is None."""
        ...

    def represent(self, observation: np.ndarray) -> np.ndarray:
        """The representation phi, float32 [n, width], that probes read."""
        ...


class Learner(Protocol):
    """An algorithm at work: it owns the policy and its optimiser, and steps the environments that it is given.

    A class may have a static method ``make_env(levels, num_envs, **options)``, which returns the environments that it
    wants. Without it, they are a :class:`segar.envs.torchrl_env.TorchRLEnv`.
    """

    policy: Any  # a PolicyNetwork and an nn.Module
    frames: int  # environment steps so far

    def __init__(self, config: AlgorithmConfig, env: VectorEnv, frames: int, seed: int) -> None:
        """``env`` holds ``config.num_envs`` environments; ``frames`` is the budget that schedules refer to."""

    @staticmethod
    def make_policy(config: AlgorithmConfig, observation_shape: tuple[int, ...], actions: int) -> nn.Module:
        """The policy's network, whose weights a checkpoint can fill; it needs no environment."""
        ...

    def iterate(self) -> Mapping[str, float]:
        """Collects and learns once, and counts ``frames``; returns figures to log.

        Progress shows ``episode/return`` and ``episode/success``, which
        :func:`segar.experiments.collection.collector.mean_figures` computes. A figure that is not finite ends the run.
        """
        ...

    def state_dict(self) -> dict[str, Any]:
        """All that decides the further course, as tensors and plain data: optimiser, counters, generators."""
        ...

    def load_state_dict(self, state: Mapping[str, Any]) -> None:
        """Continues from what :meth:`state_dict` returned."""


def learner_class(config: AlgorithmConfig) -> type[Learner]:
    """The class that ``config.learner`` names; raises :class:`ConfigError` that lists the methods which it lacks."""
    return class_behind(config, "learner", Learner, "algorithm")


def make_learner(kind: type[Learner], config: AlgorithmConfig, env: Any, frames: int, seed: int) -> Learner:
    """A learner of this class; raises :class:`ConfigError` that lists the attributes which it or its policy lacks."""
    learner, name = kind(config, env, frames, seed), f"{kind.__module__}:{kind.__qualname__}"
    require_members(learner, Learner.__annotations__, f"algorithm: {name} is no learner", Learner)
    of_policy = {**vars(PolicyNetwork), **vars(nn.Module)}
    require_members(learner.policy, of_policy, f"algorithm: the policy of {name} is none", Learner)
    return learner
