"""A learner of its own, which is PPO with a number more."""

from dataclasses import dataclass
from typing import ClassVar

from segar.experiments.algorithms.ppo import PPO
from segar.experiments.settings import PPOConfig


@dataclass(frozen=True)
class MineConfig(PPOConfig):
    """Its settings."""

    learner: ClassVar[str] = "windlab.learn:Mine"


class Mine(PPO):
    """The learner."""

    factor = 1.0
