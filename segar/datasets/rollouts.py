"""Episodes -> arrays: what happens when a policy plays, with the true factors beside what is seen."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, TypeAlias

import gymnasium
import numpy as np

from segar.envs import VectorEnv

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
        terminated, truncated, success, death: bool ``[row]``, said after that action; false in the last row.
        values: float64 ``[row, entity, column]``, the state; columns are those of ``levels.layout``.
        observations: name -> array ``[row, ...]``, what was seen.
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


def uniform(observations: Any, info: dict[str, Any], rng: np.random.Generator, space: Any) -> np.ndarray:
    """Actions drawn uniformly from the Box of all of them, float32 ``(num_envs, n)``."""
    return rng.uniform(space.low, space.high).astype(np.float32)


def play(
    env: VectorEnv, levels: np.ndarray, first_episode: int, seed: int, policy: Policy, rng: np.random.Generator
) -> Rollouts:
    """One episode in each environment.

    Args:
        env: with ``autoreset_mode`` DISABLED.
        levels: int64 ``(num_envs,)``, on which level each plays.
        first_episode: the number of the first one.
        seed: of the environments.
        policy: function of the batch of observations, ``info`` and ``rng``.
    """
    n = env.num_envs
    observations, info = env.reset(seed=seed, options={"levels": levels})
    seen, states, steps = [leaves(observations)], [env.state().state.values], []
    lengths, running = np.zeros(n, np.int64), np.ones(n, np.bool_)
    while running.any():
        actions = np.asarray(policy(observations, info, rng), np.float32)
        observations, reward, terminated, truncated, info = env.step(actions)
        taken = np.clip(actions, env.action_space.low, env.action_space.high)  # type: ignore[attr-defined]
        steps.append((taken, reward, terminated, truncated, info["success"], info["death"]))
        seen.append(leaves(observations))
        states.append(env.state().state.values)
        lengths[running] += 1
        running &= ~(terminated | truncated)
    return _joined(seen, states, steps, levels, lengths, first_episode)


def leaves(observation: Any, name: str = OBSERVATION) -> dict[str, np.ndarray]:
    """The arrays of an observation by name: 'observation', or 'observation.depth' and the like where it has parts."""
    if isinstance(observation, Mapping):
        parts = list(observation.items())
    elif isinstance(observation, tuple):
        parts = list(enumerate(observation))
    else:
        return {name: np.asarray(observation)}
    return {leaf: array for key, part in parts for leaf, array in leaves(part, f"{name}{SEPARATOR}{key}").items()}


def from_leaves(arrays: Mapping[str, np.ndarray], space: gymnasium.Space, name: str = OBSERVATION) -> Any:
    """The observation of a space whose arrays have these names: what :func:`leaves` took apart."""
    if isinstance(space, gymnasium.spaces.Dict):
        return {key: from_leaves(arrays, part, f"{name}{SEPARATOR}{key}") for key, part in space.spaces.items()}
    if isinstance(space, gymnasium.spaces.Tuple):
        return tuple(from_leaves(arrays, part, f"{name}{SEPARATOR}{k}") for k, part in enumerate(space.spaces))
    return arrays[name]


def _joined(
    seen: list[dict[str, np.ndarray]],
    states: list[np.ndarray],
    steps: list[tuple[np.ndarray, ...]],
    levels: np.ndarray,
    lengths: np.ndarray,
    first: int,
) -> Rollouts:
    """Cut what happened in all environments into episodes, and put these one after the other."""
    n = len(levels)
    rows = [(t, e) for e in range(n) for t in range(lengths[e] + 1)]
    time, env = (np.array(part, np.int64) for part in zip(*rows, strict=True))
    is_last = time == lengths[env]
    asked = np.minimum(time, len(steps) - 1)

    def column(place: int, last: Any) -> np.ndarray:
        found = np.stack([step[place] for step in steps])[asked, env]
        found[is_last] = last
        return found

    return Rollouts(
        episode=first + env,
        step=time,
        level=levels[env],
        action=column(0, np.nan),
        reward=column(1, np.nan),
        terminated=column(2, False),
        truncated=column(3, False),
        success=column(4, False),
        death=column(5, False),
        values=np.stack(states)[time, env],
        observations={name: np.stack([s[name] for s in seen])[time, env] for name in seen[0]},
    )
