"""Environments whose levels a curriculum chooses, and that record on which levels their episodes began."""

from collections import deque
from dataclasses import dataclass
from typing import Any

import numpy as np

from segar.envs import Snapshot, VectorEnv
from segar.experiments.curricula.curriculum import Curriculum
from segar.experiments.curricula.level_rows import LevelRows
from segar.levels import Levels

GONE = -1  # the row of an episode whose level was replaced
AT_ENDS = ("final_obs", "_final_obs", "final_info", "_final_info")


@dataclass(frozen=True, eq=False)
class Began:
    """Episodes that began in one step: rows of levels, with their numbers and identities; see :class:`LevelRows`."""

    levels: Levels  # of all rows at that moment
    row: np.ndarray
    number: np.ndarray
    identity: np.ndarray


@dataclass(frozen=True, eq=False)
class Step:
    """What one step of the environments was about.

    Attributes:
        row, identity: int64 ``(num_envs,)``, of the level that each environment played.
        began: the episodes that began with its end, in one part or in two.
    """

    row: np.ndarray
    identity: np.ndarray
    began: tuple[Began, ...]


@dataclass(frozen=True, eq=False)
class PlayedState:
    """Everything that decides how a :class:`PlayedEnv` goes on, and its curriculum."""

    snapshot: Snapshot
    row: np.ndarray
    identity: np.ndarray
    rows: dict[str, Any]
    curriculum: dict[str, Any]


class PlayedEnv:
    """A :class:`segar.envs.VectorEnv` whose levels a curriculum chooses; all else of it is that of the environments.

    Attributes:
        steps: those that nobody has taken yet, oldest first; a thread may append while another one takes.
        started: the episodes that resets began, until somebody takes them.
    """

    def __init__(self, env: VectorEnv, rows: LevelRows, curriculum: Curriculum) -> None:
        self._env, self._rows, self._curriculum = env, rows, curriculum
        self._row = np.full(env.num_envs, GONE)
        self._identity = np.full(env.num_envs, GONE)
        self.steps: deque[Step] = deque()
        self.started: list[Began] = []

    def __getattr__(self, name: str) -> Any:
        return getattr(self._env, name)

    def reset(self, **options: Any) -> tuple[Any, dict[str, Any]]:
        """Begins episodes everywhere; see :meth:`segar.envs.VectorEnv.reset`."""
        observation, info = self._env.reset(**options)
        everywhere = np.ones(self._env.num_envs, np.bool_)
        observation, info, began = self._begin(everywhere, observation, info)
        self.started = [*self.started, *began]
        return observation, info

    def step(self, actions: Any) -> tuple[Any, Any, Any, Any, dict[str, Any]]:
        """See :meth:`segar.envs.VectorEnv.step`."""
        observation, reward, terminated, truncated, info = self._env.step(actions)
        row, identity = self._row, self._identity
        began: tuple[Began, ...] = ()
        ended = info.get("_final_info")
        if ended is not None:
            where = ended & info["new_level"] if "new_level" in info else ended
            if where.any():
                observation, info, began = self._begin(where, observation, info)
        self.steps.append(Step(row, identity, began))
        return observation, reward, terminated, truncated, info

    def state(self) -> PlayedState:
        """A copy of everything that decides how episodes and curriculum go on; steps that nobody has taken are no part."""
        rows, curriculum = self._rows.state_dict(), self._curriculum.state_dict()
        return PlayedState(self._env.state(), self._row, self._identity, rows, curriculum)

    def restore(self, state: PlayedState) -> Any:
        """Goes on from a state; returns the observations."""
        self._curriculum.load_state_dict(state.curriculum)
        self._row, self._identity = state.row.copy(), state.identity.copy()
        self.steps.clear()
        self.started = []
        return self._env.restore(state.snapshot, self._rows.load_state_dict(state.rows))

    def _begin(
        self, where: np.ndarray, observation: Any, info: dict[str, Any]
    ) -> tuple[Any, dict[str, Any], tuple[Began, ...]]:
        """Tells the curriculum on which rows episodes began, and begins them on others where it wants so."""
        row, places = info["level"][where], np.flatnonzero(where)
        self._row, self._identity = self._row.copy(), self._identity.copy()  # earlier steps hold the arrays
        self._row[where], self._identity[where] = row, self._rows.identity[row]
        number, levels = self._rows.number[row], self._rows.levels  # the curriculum may put other levels into the rows
        instead = self._curriculum.began(row)
        same = np.ones(len(row), np.bool_) if instead is None else instead == row
        began = (Began(levels, row[same], number[same], self._identity[where][same]),) if same.any() else ()
        if instead is None or same.all():
            return observation, info, began
        mask, chosen = np.zeros(len(where), np.bool_), np.zeros(len(where), np.int64)
        mask[places[~same]], chosen[places[~same]] = True, instead[~same]
        observation, fresh = self._env.reset(options={"levels": chosen, "reset_mask": mask})
        self._row[mask], self._identity[mask] = chosen[mask], self._rows.identity[chosen[mask]]
        more = Began(self._rows.levels, chosen[mask], self._rows.number[chosen[mask]], self._identity[mask])
        kept = {name: info[name] for name in ("success", "death", *AT_ENDS) if name in info}
        return observation, {**fresh, **kept}, (*began, more)
