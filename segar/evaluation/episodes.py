"""The loop behind every evaluation: one episode, or several trials, on each of some levels, and what came of them."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, TypeAlias

import numpy as np

from segar.envs import Policy, TimeStep, VectorEnv, play, seed_of
from segar.levels import Levels

BATCH = 512  # episodes that are played at once
Columns: TypeAlias = tuple[dict[str, np.ndarray], dict[str, np.ndarray]]  # arrays, and the task's results, by name
QUANTITIES = ("return", "return_ref", "length", "success", "death")


@dataclass(frozen=True, eq=False)
class PlayedEpisodes:
    """How episodes went; arrays lead with the episode.

    Attributes:
        level: int64 ``(n,)``, index in the level set.
        returns: float64 ``(n,)``, every reward counted; ``returns_ref``: without the last reward, as the 2022
            implementation reported it.
        length: int64 ``(n,)``, steps.
        success, death: bool ``(n,)``.
        trial: int64 ``(n,)``, which episode in a row on its level each was, from 0.
        results: what the task says of the last states, by name.
    """

    level: np.ndarray
    returns: np.ndarray
    returns_ref: np.ndarray
    length: np.ndarray
    success: np.ndarray
    death: np.ndarray
    trial: np.ndarray
    results: Mapping[str, np.ndarray] = field(default_factory=dict)

    def __len__(self) -> int:
        return len(self.level)

    def columns(self) -> dict[str, np.ndarray]:
        """The arrays by the names that tables of episodes have: ``level``, :data:`QUANTITIES`, and ``trial`` if there are
        several."""
        quantities = (self.returns, self.returns_ref, self.length, self.success, self.death)
        trial = {"trial": self.trial} if self.trial.any() else {}
        return {"level": self.level, **dict(zip(QUANTITIES, quantities, strict=True)), **trial}


def play_episodes(levels: Levels, indices: np.ndarray, policy: Policy, *, seed: int, **options: Any) -> PlayedEpisodes:
    """One episode on each level that ``indices`` (int ``(n,)``) names, in that order; with several trials, first all that are
    the first on their level, then all second ones, and so on.

    Args:
        policy: acts; it begins with each batch of episodes.
        seed: of the environments, for tasks whose physics is random.
        options: of :class:`segar.envs.VectorEnv`, such as ``trials``.
    """
    parts, seed = [], seed_of(seed)
    for first in range(0, len(indices), BATCH):
        batch = indices[first : first + BATCH]
        env = VectorEnv(levels, len(batch), seed=seed + first, **options)
        start = env.reset(seed=seed + first, options={"levels": batch})
        parts.append(_played(env, policy, start))
        env.close()
    return _joined(parts)


def _played(env: VectorEnv, policy: Policy, start: tuple[Any, dict[str, Any]]) -> Columns:
    """The episodes of one batch, ``[trial, row]``."""
    trials = env.trials
    shape = (trials, env.num_envs)
    whole = {name: np.zeros(shape, np.int64) for name in ("level", "length")}
    whole |= {name: np.zeros(shape) for name in ("returns", "returns_ref")}
    whole |= {name: np.zeros(shape, np.bool_) for name in ("success", "death")}
    whole["trial"] = np.broadcast_to(np.arange(trials)[:, None], shape)
    results: dict[str, np.ndarray] = {}
    for now in play(env, policy, start, trials):
        if now.ended.any():
            _note(env, now, np.flatnonzero(now.ended), whole, results)
    return whole, results


def _note(
    env: VectorEnv, now: TimeStep, ended: np.ndarray, whole: Mapping[str, np.ndarray], results: dict[str, np.ndarray]
) -> None:
    """Write what came of the episodes that end in this step, those of the rows ``ended``."""
    final, place = now.info["final_info"], (now.trial[ended], ended)
    for name in ("level", "length", "success", "death"):
        whole[name][place] = final[name][ended]
    whole["returns"][place] = final["return"][ended]
    whole["returns_ref"][place] = final["return"][ended] - now.reward[ended]
    for name, values in env.task.results_of(env.factors_of(final, ended)).items():
        shape = (env.trials, env.num_envs, *values.shape[1:])
        results.setdefault(name, np.zeros(shape, values.dtype))[place] = values


def _joined(parts: list[Columns]) -> PlayedEpisodes:
    """All episodes of several batches, trial by trial."""

    def join(arrays: list[np.ndarray]) -> np.ndarray:
        whole = np.concatenate(arrays, axis=1)
        return whole.reshape(-1, *whole.shape[2:])

    whole, results = ({name: join([part[k][name] for part in parts]) for name in parts[0][k]} for k in (0, 1))
    return PlayedEpisodes(**whole, results=results)
