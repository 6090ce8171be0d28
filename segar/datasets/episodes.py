"""Episodes as Minari has them: what was observed and done, and the true factors beside it."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from segar.envs import Policy, TimeStep, VectorEnv, play
from segar.observations import map_leaves


@dataclass(frozen=True)
class Episode:
    """One episode of T steps; the names are those of an episode of Minari.

    Attributes:
        observations: arrays ``(T + 1, ...)``, in tuples or dicts where the observation has parts.
        actions: float32 ``(T, n)``, in the action space; rewards float64 ``(T,)``; terminations, truncations bool ``(T,)``.
        infos: the true factors, name -> float64 ``(T + 1, entities)`` or ``(T + 1, entities, 2)``, nan where an entity lacks
            one; and ``level`` int64, ``success`` and ``death`` bool, all ``(T + 1,)``.
        options: ``level``, ``seed``, ``environment``: an environment in this place of a batch, reset with this seed on this
            level, plays the episode again; with several trials, after ``trial`` further resets.
    """

    observations: Any
    actions: np.ndarray
    rewards: np.ndarray
    terminations: np.ndarray
    truncations: np.ndarray
    infos: dict[str, np.ndarray]
    options: dict[str, Any]

    def __len__(self) -> int:
        return len(self.rewards)


def roll_out(env: VectorEnv, levels: np.ndarray, seed: int, policy: Policy) -> Iterator[Episode]:
    """One episode in each environment, or all trials of its level, environment by environment.

    Args:
        env: with ``autoreset_mode`` SAME_STEP.
        levels: int64 ``(num_envs,)``, the level that each environment plays.
        seed: of the environments.
    """
    ends = np.zeros((env.num_envs, env.trials), np.int64)
    steps: list[TimeStep] = []
    for now in play(env, policy, env.reset(seed=seed, options={"levels": levels}), env.trials):
        ends[now.ended, now.trial[now.ended]] = now.time
        steps.append(now)
    starts = np.concatenate([np.zeros((env.num_envs, 1), np.int64), ends[:, :-1]], axis=1)
    for e, k in np.ndindex(ends.shape):
        options = {"level": int(levels[e]), "seed": seed, "environment": e} | ({"trial": k} if env.trials > 1 else {})
        yield episode_of(env, steps[starts[e, k] : ends[e, k] + 1], e, options)


def episode_of(env: VectorEnv, steps: Sequence[TimeStep], row: int, options: dict[str, Any]) -> Episode:
    """The episode of a row of environments; ``steps`` go from its start to its end, after which another episode may have
    started in the row. Actions are clipped to their space."""
    seen, truths = [now.observation for now in steps], [now.info for now in steps]
    space: Any = env.single_action_space
    if "final_obs" in steps[-1].info:
        seen[-1], truths[-1] = steps[-1].info["final_obs"], steps[-1].info["final_info"]
    factors = stacked([env.factors_of(info, [row]) for info in truths], 0)
    flags = {name: np.array([False, *(info[name][row] for info in truths[1:])]) for name in ("success", "death")}
    taken = steps[1:]
    return Episode(
        observations=stacked(seen, row),
        actions=np.clip(np.stack([now.action[row] for now in taken]).astype(np.float32), space.low, space.high),
        rewards=np.array([now.reward[row] for now in taken]),
        terminations=np.array([now.terminated[row] for now in taken]),
        truncations=np.array([now.truncated[row] for now in taken]),
        infos={**factors, "level": np.full(len(steps), options["level"]), **flags},
        options=options,
    )


def stacked(trees: Sequence[Any], row: int) -> Any:
    """A row of arrays in equal tuples or dicts, stacked."""
    return map_leaves(lambda *arrays: np.stack([array[row] for array in arrays]), *trees)
