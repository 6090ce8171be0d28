"""Environments: one engine, three faces, one semantics."""

from __future__ import annotations

from typing import Any

from segar.envs.gym_env import Env
from segar.envs.registration import REWARDS, register_all
from segar.envs.snapshots import Snapshot
from segar.envs.vector import VectorEnv, world_of

__all__ = ["REWARDS", "Any", "Env", "Snapshot", "TorchRLEnv", "VectorEnv", "annotations", "register_all", "world_of"]


def __getattr__(name: str) -> Any:
    """``TorchRLEnv`` is loaded when it is asked for, so that ``import segar`` stays free of torch."""
    if name == "TorchRLEnv":
        from segar.envs.torchrl_env import TorchRLEnv

        return TorchRLEnv
    raise AttributeError(f"module 'segar.envs' has no attribute '{name}'")
