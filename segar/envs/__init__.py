"""Environments: the batched core, and the interfaces of Gymnasium and TorchRL to it.

The room puts engine, levels, tasks, observations and rendering together. Other rooms use the names below.
"""

from segar.envs.gym_env import Env
from segar.envs.playing import Act, StepSource, TimeStep, play
from segar.envs.registration import REWARDS, register_all
from segar.envs.snapshots import Snapshot
from segar.envs.vector import VectorEnv, world_of

__all__ = [
    "REWARDS", "Act", "Env", "Snapshot", "StepSource", "TimeStep", "TorchRLEnv", "VectorEnv", "play", "register_all",
    "world_of",
]  # fmt: skip


def __getattr__(name: str) -> type:
    """Load ``TorchRLEnv`` when it is asked for, so that ``import segar`` does not load torch."""
    if name == "TorchRLEnv":
        from segar.envs.torchrl_env import TorchRLEnv

        return TorchRLEnv
    raise AttributeError(f"module 'segar.envs' has no attribute '{name}'")
