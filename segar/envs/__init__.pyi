from .checks import (
    actions_of as actions_of,
    known_options as known_options,
    require_known as require_known,
    seed_of as seed_of,
)
from .gym_env import Env
from .gymnasium_ids import (
    OBSERVATION_NAMES as OBSERVATION_NAMES,
    REWARDS as REWARDS,
    register_all as register_all,
    register_id as register_id,
)
from .level_pool import LevelPool as LevelPool
from .playing import (
    Policy as Policy,
    StepSource as StepSource,
    TimeStep as TimeStep,
    begin_policy as begin_policy,
    play as play,
)
from .sb3_env import SB3VecEnv
from .snapshots import Snapshot
from .target_calls import build_environment, environment_calls as environment_calls
from .torchrl_env import TorchRLEnv
from .vector import VectorEnv, world_of as world_of

__all__ = ["Env", "SB3VecEnv", "Snapshot", "TorchRLEnv", "VectorEnv", "build_environment"]
