"""The loop that plays episodes: one in each row of a batch, or all trials of a level, from the start until all are over."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from typing import Any, Protocol, TypeAlias

import numpy as np

ROW_ARRAYS = ("episodes", "trial", "action", "reward", "terminated", "truncated", "played", "running")


@dataclass(frozen=True, eq=False)
class TimeStep:
    """What is known after the start, or after a step, of rows of episodes that are played side by side.

    Attributes:
        time: steps that were taken; 0 after the start.
        episodes: int64 ``(n,)``, the number of the episode that each row of the arrays is about; with several trials, that
            of the row of episodes.
        trial: int64 ``(n,)``, which episode of its row the step belongs to, from 0.
        observation, info: as the source of the steps gave them.
        action: float ``(n, action size)``, what led here; reward: float64 ``(n,)``; terminated, truncated: bool
            ``(n,)``. All are zero after the start.
        played: bool ``(n,)``, whether the step belongs to an episode of the row. It does not where all were over before.
        running: bool ``(n,)``, whether the row's episode goes on, or another one follows.
    """

    time: int
    episodes: np.ndarray
    trial: np.ndarray
    observation: Any
    info: dict[str, Any]
    action: np.ndarray
    reward: np.ndarray
    terminated: np.ndarray
    truncated: np.ndarray
    played: np.ndarray
    running: np.ndarray

    @property
    def ended(self) -> np.ndarray:
        """Bool ``(n,)``: whether this step was the last one of an episode."""
        return self.played & (self.terminated | self.truncated)


Act: TypeAlias = Callable[[TimeStep], np.ndarray]
"""Gives the actions of all rows, float ``(n, action size)``; those of episodes that are over have no effect on others."""


class StepSource(Protocol):
    """What :func:`play` steps: a :class:`segar.envs.VectorEnv`, or another batch of episodes.

    A source may have a method ``shrink(kept)``. It is called when half of the rows or more are over, drops all rows but
    ``kept`` (bool ``(n,)``), and returns the observations of the rows that remain.
    """

    num_envs: int  # rows at the start

    def step(self, actions: np.ndarray, /) -> tuple[Any, np.ndarray, np.ndarray, np.ndarray, dict[str, Any]]:
        """Advance all rows; return observations, rewards, terminated, truncated, info, as Gymnasium has them."""
        ...


def play(source: StepSource, act: Act, start: tuple[Any, dict[str, Any]], trials: int = 1) -> Iterator[TimeStep]:
    """Play one episode, or several trials, in each row of ``source``: yields the start, then every step, until all are over.

    Rows whose episode is over are stepped on, because a batch moves as one, unless the source drops them. To stop
    early, stop iterating.

    >>> env = segar.envs.VectorEnv(segar.family("empty-hard").sample(4, seed=0), 4, seed=0, max_steps=10)
    >>> idle = lambda now: np.zeros((len(now.running), 2), np.float32)
    >>> [now.time for now in segar.envs.play(env, idle, env.reset(options={"levels": np.arange(4)}))][-1]
    10

    Args:
        act: chooses the actions of a step; it is called when the caller asks for that step.
        start: observations and info from which the episodes begin, e.g. ``env.reset(options={"levels": levels})``.
        trials: episodes of each row. Where there are several, the source starts the next one in the step that ends one, as
            environments with ``trials`` and ``autoreset_mode`` SAME_STEP do.
    """
    n = source.num_envs
    none, zero, first = np.zeros(n, np.bool_), np.zeros(n), np.zeros(n, np.int64)
    now = TimeStep(0, np.arange(n), first, *start, np.zeros((n, 0)), zero, none, none, played=none, running=~none)
    yield now
    shrink = getattr(source, "shrink", None)
    while now.running.any():
        if shrink is not None and 2 * now.running.sum() <= len(now.running):
            rows = {name: getattr(now, name)[now.running] for name in ROW_ARRAYS}
            now = replace(now, observation=shrink(now.running), **rows)
        action = act(now)
        trial = now.trial + (now.ended & now.running)
        observation, reward, terminated, truncated, info = source.step(action)
        is_over = (terminated | truncated) & (trial == trials - 1)
        now = TimeStep(
            now.time + 1, now.episodes, trial, observation, info, action, reward, terminated, truncated,
            played=now.running, running=now.running & ~is_over,
        )  # fmt: skip
        yield now
