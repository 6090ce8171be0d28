"""The loop behind every evaluation: one episode on each of some levels, and what came of it."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from segar.envs import Act, StepSource, TimeStep, VectorEnv, play
from segar.levels import Levels

BATCH = 512  # episodes that are played at once
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
        results: what the task says of the last states, by name.
    """

    level: np.ndarray
    returns: np.ndarray
    returns_ref: np.ndarray
    length: np.ndarray
    success: np.ndarray
    death: np.ndarray
    results: Mapping[str, np.ndarray] = field(default_factory=dict)

    def __len__(self) -> int:
        return len(self.level)

    def columns(self) -> dict[str, np.ndarray]:
        """The arrays by the names that tables of episodes have: ``level``, and :data:`QUANTITIES`."""
        quantities = (self.returns, self.returns_ref, self.length, self.success, self.death)
        return {"level": self.level, **dict(zip(QUANTITIES, quantities, strict=True))}


def play_episodes(
    levels: Levels, indices: np.ndarray, make_act: Callable[[VectorEnv], Act], *, seed: int, **options: Any
) -> PlayedEpisodes:
    """One episode on each level that ``indices`` (int ``(n,)``) names, in that order.

    Args:
        make_act: gives what :func:`segar.envs.play` asks for actions; called when the episodes of a batch have started.
        seed: of the environments, for tasks whose physics is random.
        options: of :class:`segar.envs.VectorEnv`.
    """
    parts = []
    for first in range(0, len(indices), BATCH):
        batch = indices[first : first + BATCH]
        env = VectorEnv(levels, len(batch), seed=seed + first, **options)
        start = env.reset(seed=seed + first, options={"levels": batch})
        parts.append(_played(env, make_act(env), start))
        env.close()
    return _joined(parts)


def _played(env: StepSource, act: Act, start: tuple[Any, dict[str, Any]]) -> PlayedEpisodes:
    """The episodes of one batch, in the order of its rows."""
    n = env.num_envs
    whole = {name: np.zeros(n, np.int64) for name in ("level", "length")}
    whole |= {name: np.zeros(n) for name in ("returns", "returns_ref")}
    whole |= {name: np.zeros(n, np.bool_) for name in ("success", "death")}
    results: dict[str, np.ndarray] = {}
    for now in play(env, act, start):
        if now.ended.any():
            _note(now, np.flatnonzero(now.ended), whole, results)
    return PlayedEpisodes(**whole, results=results)


def _note(now: TimeStep, ended: np.ndarray, whole: Mapping[str, np.ndarray], results: dict[str, np.ndarray]) -> None:
    """Write what came of the episodes that end in this step into the rows ``ended``."""
    final = now.info["final_info"]
    for name in ("level", "length", "success", "death"):
        whole[name][ended] = final[name][ended]
    whole["returns"][ended] = final["return"][ended]
    whole["returns_ref"][ended] = final["return"][ended] - now.reward[ended]
    for name, values in final["results"].items():
        values = np.asarray(values)
        results.setdefault(name, np.zeros(values.shape, values.dtype))[ended] = values[ended]


def _joined(parts: list[PlayedEpisodes]) -> PlayedEpisodes:
    """All episodes of several batches."""
    arrays = [{name: array for name, array in vars(part).items() if name != "results"} for part in parts]
    whole = {name: np.concatenate([part[name] for part in arrays]) for name in arrays[0]}
    results = {name: np.concatenate([part.results[name] for part in parts]) for name in parts[0].results}
    return PlayedEpisodes(**whole, results=results)
