"""Collecting experience: collectors of rollouts, the replay of off-policy learners, and rewards as learners see them.

Authors of algorithms import from here. The modules of ``experiments`` name the file instead, so that the code that a run is
resumed under is only the code that it executes.
"""

from segar.experiments.collection.async_collector import AsyncCollector
from segar.experiments.collection.collector import (
    ActorCritic,
    Collected,
    Collector,
    Rollout,
    action_size,
    figures_at_end,
    mean_figures,
    observation_shape,
)
from segar.experiments.collection.device_collector import DeviceCollector
from segar.experiments.collection.environment_state import as_tensors, from_tensors
from segar.experiments.collection.replay import Replay
from segar.experiments.collection.rewards import ReturnScale, learner_reward

__all__ = [
    "ActorCritic",
    "AsyncCollector",
    "Collected",
    "Collector",
    "DeviceCollector",
    "Replay",
    "ReturnScale",
    "Rollout",
    "action_size",
    "as_tensors",
    "figures_at_end",
    "from_tensors",
    "learner_reward",
    "mean_figures",
    "observation_shape",
]  # fmt: skip
