"""What acts, and the loop that plays episodes: one in each row of a batch, or all trials of a level, until all are over."""

import inspect
from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Any, Protocol

import numpy as np

from segar.errors import SegarError

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


class Policy(Protocol):
    """What acts: a function, or an object that can be called.

    A policy that remembers, or that reads more than observations, has a method ``begin(env)``, too. It is called when the
    episodes of a batch have started in ``env``, before the first actions are asked for. With several trials it is called when
    the first one starts, and not between trials. ``env`` is what :func:`play` steps: a :class:`segar.envs.VectorEnv`, whose
    ``factors`` are the true ones.

    A policy whose ``only_running`` is true is given the observations of those rows alone whose episode goes on, where these
    are a single array.
    """

    def __call__(self, observations: Any, /) -> Any:
        """Actions ``(n, action size)`` for the observations ``(n, ...)`` of all n rows of a batch; those of episodes that are
        over have no effect on others."""


def begin_policy(policy: Any, env: Any) -> None:
    """Tell a policy that episodes have started in ``env``, if it has a method ``begin(env)``.

    Raises:
        SegarError: its ``begin`` takes something else.
    """
    begin = getattr(policy, "begin", None)
    if begin is None:
        return
    try:
        signature = inspect.signature(begin)
    except (TypeError, ValueError):  # of what is not written in Python, nothing is known
        signature = None
    if signature is not None:
        try:
            signature.bind(env)
        except TypeError as error:
            raise SegarError(
                f"the policy's begin{signature} must take one argument, the environments: begin(env); {error}"
            ) from error
    begin(env)


class StepSource(Protocol):
    """What :func:`play` steps: a :class:`segar.envs.VectorEnv`, or another batch of episodes.

    A source may have a method ``shrink(kept)``. It is called when half of the rows or more are over, drops all rows but
    ``kept`` (bool ``(n,)``), and returns the observations of the rows that remain.
    """

    num_envs: int  # rows at the start

    def step(self, actions: np.ndarray, /) -> tuple[Any, np.ndarray, np.ndarray, np.ndarray, dict[str, Any]]:
        """Advance all rows; return observations, rewards, terminated, truncated, info, as Gymnasium has them."""
        ...


def play(source: StepSource, policy: Policy, start: tuple[Any, dict[str, Any]], trials: int = 1) -> Iterator[TimeStep]:
    """Play one episode, or several trials, in each row of ``source``: yields the start, then every step, until all are over.

    Rows whose episode is over are stepped on, because a batch moves as one, unless the source drops them. To stop
    early, stop iterating.

    >>> env = segar.envs.VectorEnv(segar.family("empty-hard").sample(4, seed=0), 4, seed=0, max_steps=10)
    >>> idle = lambda observations: np.zeros((4, 2), np.float32)
    >>> [now.time for now in segar.envs.play(env, idle, env.reset(options={"levels": np.arange(4)}))][-1]
    10

    Args:
        policy: chooses the actions of a step; it is called when the caller asks for that step.
        start: observations and info from which the episodes begin, e.g. ``env.reset(options={"levels": levels})``.
        trials: episodes of each row. Where there are several, the source starts the next one in the step that ends one, as
            environments with ``trials`` and ``autoreset_mode`` SAME_STEP do.
    """
    n = source.num_envs
    none, zero, first = np.zeros(n, np.bool_), np.zeros(n), np.zeros(n, np.int64)
    now = TimeStep(0, np.arange(n), first, *start, np.zeros((n, 0)), zero, none, none, played=none, running=~none)
    yield now
    begin_policy(policy, source)
    shrink = getattr(source, "shrink", None)
    while now.running.any():
        if shrink is not None and 2 * now.running.sum() <= len(now.running):
            rows = {name: getattr(now, name)[now.running] for name in ROW_ARRAYS}
            now = replace(now, observation=shrink(now.running), **rows)
        action = _actions(policy, now)
        trial = now.trial + (now.ended & now.running)
        observation, reward, terminated, truncated, info = source.step(action)
        is_over = (terminated | truncated) & (trial == trials - 1)
        now = TimeStep(
            now.time + 1, now.episodes, trial, observation, info, action, reward, terminated, truncated,
            played=now.running, running=now.running & ~is_over,
        )  # fmt: skip
        yield now


def _actions(policy: Policy, now: TimeStep) -> Any:
    """The actions of all rows; 0 for episodes that are over where the policy is not asked for them."""
    if not getattr(policy, "only_running", False) or now.running.all() or not isinstance(now.observation, np.ndarray):
        return policy(now.observation)
    chosen = policy(now.observation[now.running])
    actions = np.zeros((len(now.running), *chosen.shape[1:]), chosen.dtype)
    actions[now.running] = chosen
    return actions
