"""Episodes as arrays: what a policy observes and does, and the true factors."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, TypeAlias

import gymnasium
import numpy as np

from segar.envs import TimeStep, VectorEnv, play

Policy: TypeAlias = Callable[[Any, dict[str, Any], np.random.Generator], np.ndarray]
SEPARATOR = "."  # between the parts of the name of an array within an observation
OBSERVATION = "observation"


@dataclass(frozen=True)
class Rollouts:
    """Episodes, one after the other. A row is a state: an episode of T steps has T + 1 rows.

    Attributes:
        episode, step, level: int64 ``[row]``.
        action: float32 ``[row, n]``, taken in this state; nan in the last row of an episode, where none is.
        reward: float64 ``[row]``, of that action; nan in the last row.
        terminated, truncated, success, death: bool ``[row]``, after that action; false in the last row.
        values: float64 ``[row, entity, column]``, the state; columns are those of ``levels.layout``.
        observations: name -> array ``[row, ...]``, what was observed.
    """

    episode: np.ndarray
    step: np.ndarray
    level: np.ndarray
    action: np.ndarray
    reward: np.ndarray
    terminated: np.ndarray
    truncated: np.ndarray
    success: np.ndarray
    death: np.ndarray
    values: np.ndarray
    observations: Mapping[str, np.ndarray]

    def __len__(self) -> int:
        return len(self.episode)


def roll_out(
    env: VectorEnv, levels: np.ndarray, first_episode: int, seed: int, policy: Policy, rng: np.random.Generator
) -> Rollouts:
    """One episode in each environment.

    Args:
        env: with ``autoreset_mode`` DISABLED.
        levels: int64 ``(num_envs,)``, the level that each environment plays.
        first_episode: the number of the first episode.
        seed: of the environments.
        policy: function of the batch of observations, ``info`` and ``rng``.
    """

    def act(now: TimeStep) -> np.ndarray:
        return np.asarray(policy(now.observation, now.info, rng), np.float32)

    low, high = np.array(env.task.action_low, np.float32), np.array(env.task.action_high, np.float32)
    lengths = np.zeros(env.num_envs, np.int64)
    seen, states, steps = [], [], []
    for now in play(env, act, env.reset(seed=seed, options={"levels": levels})):
        seen.append(leaves(now.observation))
        states.append(env.state().state.values)
        lengths += now.played
        if now.time:
            outcome = {name: getattr(now, name) for name in ("reward", "terminated", "truncated")}
            outcome |= {name: now.info[name] for name in ("success", "death")}
            steps.append({"action": np.clip(now.action, low, high), **outcome})
    episodes = [(time, e) for e, length in enumerate(lengths) for time in range(length + 1)]
    time, env_of = (np.array(part, np.int64) for part in zip(*episodes, strict=True))
    is_last = time == lengths[env_of]

    def after_step(name: str) -> np.ndarray:
        found = np.stack([step[name] for step in steps])[np.minimum(time, len(steps) - 1), env_of]
        found[is_last] = np.nan if found.dtype.kind == "f" else False
        return found

    return Rollouts(
        episode=first_episode + env_of,
        step=time,
        level=levels[env_of],
        **{name: after_step(name) for name in steps[0]},
        values=np.stack(states)[time, env_of],
        observations={name: np.stack([s[name] for s in seen])[time, env_of] for name in seen[0]},
    )


def leaves(observation: Any, name: str = OBSERVATION) -> dict[str, np.ndarray]:
    """The arrays of an observation by name: 'observation', or 'observation.depth' and the like where it has parts."""
    if not isinstance(observation, (Mapping, tuple)):
        return {name: np.asarray(observation)}
    parts = observation.items() if isinstance(observation, Mapping) else enumerate(observation)
    return {leaf: array for key, part in parts for leaf, array in leaves(part, f"{name}{SEPARATOR}{key}").items()}


def from_leaves(arrays: Mapping[str, np.ndarray], space: gymnasium.Space, name: str = OBSERVATION) -> Any:
    """The observation of a space whose arrays have these names: what :func:`leaves` took apart."""
    if isinstance(space, gymnasium.spaces.Dict):
        return {key: from_leaves(arrays, part, f"{name}{SEPARATOR}{key}") for key, part in space.spaces.items()}
    if isinstance(space, gymnasium.spaces.Tuple):
        return tuple(from_leaves(arrays, part, f"{name}{SEPARATOR}{k}") for k, part in enumerate(space.spaces))
    return arrays[name]
