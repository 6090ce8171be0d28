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
STATE = "state"  # the name of the states among what is noted; names of arrays begin with OBSERVATION


@dataclass(frozen=True)
class Rollouts:
    """Episodes, one after the other. A row is a state: an episode of T steps has T + 1 rows.

    Attributes:
        episode, step, level: int64 ``[row]``.
        trial: int64 ``[row]``, which episode in a row on its level it is, from 0.
        action: float32 ``[row, n]``, taken in this state; nan in the last row of an episode, where none is.
        reward: float64 ``[row]``, of that action; nan in the last row.
        terminated, truncated, success, death: bool ``[row]``, after that action; false in the last row.
        values: float64 ``[row, entity, column]``, the state; columns are those of ``levels.layout``.
        observations: name -> array ``[row, ...]``, what was observed.
    """

    episode: np.ndarray
    step: np.ndarray
    level: np.ndarray
    trial: np.ndarray
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
    """One episode in each environment, or all trials of a level, one after the other.

    Args:
        env: with ``autoreset_mode`` DISABLED; its ``trials`` are played.
        levels: int64 ``(num_envs,)``, the level that each environment plays.
        first_episode: the number of the first episode.
        seed: of the environments.
        policy: function of the batch of observations, ``info`` and ``rng``.
    """

    def act(now: TimeStep) -> np.ndarray:
        return np.asarray(policy(now.observation, now.info, rng), np.float32)

    noted, ends = NotedSteps(env), np.zeros((env.num_envs, env.trials), np.int64)
    for now in play(noted, act, noted.start(seed, levels), env.trials):
        ends[now.ended, now.trial[now.ended]] = now.time
    starts = np.concatenate([np.zeros((env.num_envs, 1), np.int64), ends[:, :-1]], axis=1)
    rows = [(e, k, t) for e, k in np.ndindex(ends.shape) for t in range(starts[e, k], ends[e, k] + 1)]
    env_of, trial, time = (np.array(part, np.int64) for part in zip(*rows, strict=True))
    is_last = time == ends[env_of, trial]

    def after_step(name: str) -> np.ndarray:
        steps = noted.steps
        found = np.stack([step[name] for step in steps])[np.minimum(time, len(steps) - 1), env_of]
        found[is_last] = np.nan if found.dtype.kind == "f" else False
        return found

    def in_state(name: str) -> np.ndarray:
        found = np.stack([seen[name] for seen in noted.before])[time, env_of]
        for row in np.flatnonzero(is_last):  # of which a trial that follows shows its own start
            found[row] = noted.after[time[row] - 1][name][env_of[row]]
        return found

    return Rollouts(
        episode=first_episode + env_of * env.trials + trial,
        step=time - starts[env_of, trial],
        level=levels[env_of],
        trial=trial,
        **{name: after_step(name) for name in noted.steps[0]},
        values=in_state(STATE),
        observations={name: in_state(name) for name in noted.before[0] if name != STATE},
    )


class NotedSteps:
    """Environments whose states and observations are noted, and which start the next trial in the step that ends one.

    Args:
        env: with ``autoreset_mode`` DISABLED.

    Attributes:
        before: what was seen before each step, by name, and after the last one; :data:`STATE` is the state.
        after: the same after each step, before another trial starts.
        steps: actions as they were taken, and what came of them, by name.
    """

    def __init__(self, env: VectorEnv) -> None:
        self.env, self.num_envs = env, env.num_envs
        self.before: list[dict[str, np.ndarray]] = []
        self.after: list[dict[str, np.ndarray]] = []
        self.steps: list[dict[str, np.ndarray]] = []

    def start(self, seed: int, levels: np.ndarray) -> tuple[Any, dict[str, Any]]:
        """Start on these levels; return observations and info."""
        observation, info = self.env.reset(seed=seed, options={"levels": levels})
        self.before.append(self._seen(observation))
        return observation, info

    def step(self, actions: np.ndarray) -> tuple[Any, np.ndarray, np.ndarray, np.ndarray, dict[str, Any]]:
        """Take a step; see :class:`segar.envs.StepSource`."""
        task = self.env.task
        observation, reward, terminated, truncated, info = self.env.step(actions)
        taken = np.clip(actions, np.array(task.action_low, np.float32), np.array(task.action_high, np.float32))
        outcome = {"reward": reward, "terminated": terminated, "truncated": truncated}
        self.steps.append({"action": taken, **outcome, **{name: info[name] for name in ("success", "death")}})
        self.after.append(self._seen(observation))
        ended = terminated | truncated
        if self.env.trials == 1 or not ended.any():
            self.before.append(self.after[-1])
        else:
            observation, info = self.env.reset(options={"reset_mask": ended})
            self.before.append(self._seen(observation))
        return observation, reward, terminated, truncated, info

    def _seen(self, observation: Any) -> dict[str, np.ndarray]:
        return {**leaves(observation), STATE: self.env.state().state.values}


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
