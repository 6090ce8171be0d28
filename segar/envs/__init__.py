"""Environments: the batched core, and the interfaces of Gymnasium, TorchRL and Stable-Baselines3 to it.

The room puts engine, levels, tasks, observations and rendering together. Other rooms use the names below.
"""

from segar.envs.checks import actions_of, known_options, require_known
from segar.envs.gym_env import Env
from segar.envs.level_pool import LevelPool
from segar.envs.playing import Act, StepSource, TimeStep, play
from segar.envs.registration import REWARDS, register_all
from segar.envs.snapshots import Snapshot
from segar.envs.target_calls import EnvironmentCalls, build_environment, environment_calls
from segar.envs.vector import VectorEnv, world_of
from segar.support import need

__all__ = [
    "REWARDS", "Act", "Env", "EnvironmentCalls", "LevelPool", "SB3VecEnv", "Snapshot", "StepSource", "TimeStep", "TorchRLEnv",
    "VectorEnv", "actions_of", "build_environment", "environment_calls", "known_options", "play", "register_all",
    "require_known", "world_of",
]  # fmt: skip


def __getattr__(name: str) -> type:
    """Load what needs an optional package when it is asked for, so that ``import segar`` does not load torch."""
    if name == "TorchRLEnv":
        from segar.envs.torchrl_env import TorchRLEnv

        return TorchRLEnv
    if name == "SB3VecEnv":
        need("SB3VecEnv", "stable_baselines3")
        from segar.envs.sb3_env import SB3VecEnv

        return SB3VecEnv
    raise AttributeError(f"module 'segar.envs' has no attribute '{name}'")
