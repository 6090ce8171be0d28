"""Whole episodes in one batch, without an environment around them: where they start, who plays, how they end."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from segar.engine import Simulator, State, StepResult
from segar.envs import VectorEnv
from segar.errors import SegarError
from segar.language import Factors, Task
from segar.levels import Levels, require_levels

Player = Callable[[int, np.ndarray, np.ndarray], np.ndarray]
"""``player(step, rows, values)`` gives float ``(len(rows), action size)``: what these rows of the batch do in the states
``values``, ``(len(rows), entities, columns)``. It is asked for the rows whose episodes may still be running."""


@dataclass(frozen=True, eq=False)
class Episodes:
    """How a batch of episodes went; arrays lead with the episode.

    Attributes:
        solved: bool ``(n,)``. died: bool ``(n,)``.
        steps: int64 ``(n,)``, until the episode ended or its time was out.
        returns: float64 ``(n,)``, every reward counted.
        last_reward: float64 ``(n,)``, the reward of the last step.
        actions: float32 ``(n, max steps, action size)``, as they were played; zero after the end.
        values: float64 ``(n, entities, columns)``, the state at the end.
    """

    solved: np.ndarray
    died: np.ndarray
    steps: np.ndarray
    returns: np.ndarray
    last_reward: np.ndarray
    actions: np.ndarray
    values: np.ndarray


@dataclass(frozen=True, eq=False)
class Starts:
    """The first states of one episode on each level of a set, and what plays on from them.

    Attributes:
        levels, task, simulator: what is played.
        state: ``len(levels)`` states; row i is level i.
        seed: of the randomness in rules, as ``VectorEnv(levels, len(levels), seed=seed)`` has it.
    """

    levels: Levels
    task: Task
    simulator: Simulator
    state: State
    seed: int

    def fork(self, rows: np.ndarray) -> State:
        """Copies of the first states of these levels, repeated as often as they are named."""
        return State(**{name: array[rows] for name, array in vars(self.state).items()})


def make_starts(levels: Levels, task: Task | None = None, seed: int = 0, num_threads: int = 1) -> Starts:
    """The first states of one episode per level, exactly as a fresh :class:`segar.envs.VectorEnv` starts them.

    Raises:
        SegarError: there are no levels, or they do not fit the task.
    """
    require_levels("hardness", levels)
    if task is not None and not isinstance(task, Task):
        raise SegarError(f"hardness: task must be a segar.Task such as segar.puttputt(), not {task!r}")
    env = VectorEnv(levels, max(len(levels), 1), task=task, seed=seed, num_threads=num_threads)
    env.reset(options={"levels": np.arange(len(levels))})
    return Starts(levels, env.task, env.simulator, env.state().state, seed)


def play(
    starts: Starts,
    rows: np.ndarray,
    player: Player,
    limits: np.ndarray | None = None,
    keys: np.ndarray | None = None,
) -> Episodes:
    """One episode from the start of each level in ``rows`` (int ``(n,)``, repeated as one likes), by ``player``.

    What is over is not simulated any further: the batch is made smaller when half of it has ended.

    Args:
        limits: int ``(n,)``, steps after which an episode is broken off; the task's time limit where it is None.
        keys: uint64 ``(n,)`` of the randomness in rules; those that follow from the seed where it is None.
    """
    n, task, size = len(rows), starts.task, len(starts.task.action_low)
    low, high = np.array(task.action_low, np.float32), np.array(task.action_high, np.float32)
    limits = np.full(n, task.max_steps) if limits is None else limits
    solved, died = np.zeros(n, np.bool_), np.zeros(n, np.bool_)
    steps, returns, last = np.zeros(n, np.int64), np.zeros(n), np.zeros(n)
    actions = np.zeros((n, task.max_steps, size), np.float32)
    state, live = starts.fork(rows), np.arange(n)  # the episode that each row of the state plays
    state.key = state.key if keys is None else keys
    values, running, outcome = state.values.copy(), np.ones(n, np.bool_), StepResult.empty(n)
    for t in range(limits.max()):
        chosen = np.asarray(player(t, live, state.values), np.float32)
        if not np.isfinite(chosen).all():
            raise SegarError(f"task {task.name}: the player gave actions in step {t} that are not finite")
        chosen = np.clip(chosen, low, high)
        starts.simulator.act(state, starts.levels, np.ascontiguousarray(chosen), outcome)
        on = live[running]
        actions[on, t] = chosen[running]
        steps[on] += 1
        returns[on] += outcome.reward[running]
        last[on] = outcome.reward[running]
        ended = running & (outcome.terminated | (t + 1 >= limits[live]))
        over = live[ended]
        solved[over], died[over], values[over] = outcome.success[ended], outcome.death[ended], state.values[ended]
        running &= ~ended
        if not running.any():
            break
        if running.sum() * 2 <= len(live):
            state = State(**{name: array[running] for name, array in vars(state).items()})
            live = live[running]
            running, outcome = np.ones(len(live), np.bool_), StepResult.empty(len(live))
    return Episodes(solved, died, steps, returns, last, actions, values)


def trace(starts: Starts, rows: np.ndarray, actions: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """All states that these actions lead through, from the starts of the levels in ``rows``.

    Args:
        actions: float ``(len(rows), steps, action size)``.

    Returns:
        float64 ``(len(rows), steps + 1, entities, columns)``, and the step at which each episode ended, int
        ``(len(rows),)``, ``steps + 1`` where it did not. What has ended stands still.
    """
    n, length = actions.shape[:2]
    state, outcome = starts.fork(rows), StepResult.empty(n)
    states = np.empty((n, length + 1, *state.values.shape[1:]))
    states[:, 0] = state.values
    ends = np.full(n, length + 1)
    actions = np.asarray(actions, np.float32)
    for t in range(length):
        starts.simulator.act(state, starts.levels, np.ascontiguousarray(actions[:, t]), outcome)
        over = ends <= t
        states[:, t + 1] = np.where(over[:, None, None], states[:, t], state.values)
        ends[~over & outcome.terminated] = t + 1
    return states, ends


def open_loop(actions: np.ndarray) -> Player:
    """The player that plays ``actions[row, step]``; float ``(n, max steps, action size)``."""
    return lambda step, rows, values: actions[rows, step]


def scripted(starts: Starts) -> Player | None:
    """The scripted player of the task, None where it has none."""
    demo, layout = starts.task.demo_actions, starts.levels.layout
    return None if demo is None else lambda step, rows, values: demo(Factors(layout, values))


def uniform_actions(task: Task, n: int, steps: int, rng: np.random.Generator) -> np.ndarray:
    """Actions drawn uniformly from the task's range, float32 ``(n, steps, action size)``."""
    low, high = np.array(task.action_low), np.array(task.action_high)
    return (low + (high - low) * rng.random((n, steps, len(low)))).astype(np.float32)
