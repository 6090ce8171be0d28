"""What training asks of an algorithm: a learner that goes on by iterations, and a policy that acts.

An algorithm of your own is a sub-class of :class:`experiments.settings.AlgorithmConfig` whose ``learner`` names a class
like this one, and a YAML in ``conf/algorithm/`` whose ``type`` names the dataclass.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Protocol

import numpy as np
import torch
from torch import nn

from experiments.settings import AlgorithmConfig


class Policy(Protocol):
    """A network that acts; also an ``nn.Module``, so that its weights can be stored.

    One with a memory, or one that must know more than it observes, has a method ``begin(env)``, too: evaluation calls it
    when the episodes of a batch start in a :class:`segar.envs.VectorEnv`.
    """

    def act(self, observation: np.ndarray, *, rng: torch.Generator | None) -> np.ndarray:
        """Actions float32 [n, 2] for observations [n, ...]; sampled with ``rng``, deterministic where it is None."""
        ...

    def represent(self, observation: np.ndarray) -> np.ndarray:
        """The representation phi, float32 [n, width], that probes look at."""
        ...


class Learner(Protocol):
    """An algorithm at work: it owns the policy and its optimiser, and steps the environments that it is given."""

    policy: Any  # a Policy and an nn.Module
    frames: int  # environment steps so far

    def __init__(self, config: AlgorithmConfig, env: Any, frames: int, seed: int) -> None:
        """``frames`` is the budget that schedules refer to.

        ``env`` holds ``config.num_envs`` environments: a :class:`segar.envs.torchrl_env.TorchRLEnv`, or what the static
        method ``make_env(levels, num_envs, **options)`` gives in a class that has one.
        """
        ...

    @staticmethod
    def make_policy(config: AlgorithmConfig, observation_shape: tuple[int, ...], actions: int) -> nn.Module:
        """The policy's network, whose weights a checkpoint can fill; needs no environment."""
        ...

    def iterate(self) -> Mapping[str, float]:
        """Collects and learns once; returns figures to log, among them means over ended episodes, e.g. ``episode/return``."""
        ...

    def state_dict(self) -> dict[str, Any]:
        """All that decides the further course, as tensors and plain data: optimiser, counters, generators."""
        ...

    def load_state_dict(self, state: Mapping[str, Any]) -> None:
        """Goes on from what :meth:`state_dict` returned."""
        ...
