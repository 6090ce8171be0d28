"""Whole episodes from copies of first states: where they start, who plays them, how they end."""

from dataclasses import dataclass

import numpy as np

from segar.engine import Simulator, State, StepResult
from segar.envs import Policy, VectorEnv, play
from segar.errors import SegarError
from segar.language import Factors, Task
from segar.levels import Levels, checks


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


def make_starts(levels: Levels, task: Task | None = None, seed: int = 0, num_threads: int = 1) -> Starts:
    """The first states of one episode per level, exactly as a fresh :class:`segar.envs.VectorEnv` starts them.

    Raises:
        SegarError: there are no levels, or they do not fit the task.
    """
    checks.require_levels("hardness", levels)
    if task is not None and not isinstance(task, Task):
        raise SegarError(f"hardness: task must be a segar.Task such as segar.puttputt(), not {task!r}")
    env = VectorEnv(levels, max(len(levels), 1), task=task, seed=seed, num_threads=num_threads)
    env.reset(options={"levels": np.arange(len(levels))})
    return Starts(levels, env.task, env.simulator, env.state().state, seed)


class ForkedEpisodes:
    """Episodes that go on from copies of first states: what :func:`segar.envs.play` steps without an environment.

    Its observations are the states, float64 ``(n, entities, columns)``, which the next step overwrites. It drops rows
    that are over, and draws no further episode.

    Args:
        rows: int ``(n,)``, the level of each episode; a level may occur any number of times.
        limits: int ``(n,)``, steps after which an episode is truncated.
        keys: uint64 ``(n,)`` of the randomness in rules; those that follow from the seed where it is None.

    Attributes:
        time: steps that were taken.
        episodes: int64, which of the ``n`` episodes the rows of the batch are.
    """

    def __init__(self, starts: Starts, rows: np.ndarray, limits: np.ndarray, keys: np.ndarray | None = None) -> None:
        self.starts, self.num_envs, self.limits, self.time = starts, len(rows), limits, 0
        self.episodes = np.arange(self.num_envs)
        self._keep(starts.state, rows)
        self.state.key = self.state.key if keys is None else keys

    def step(self, actions: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray, dict[str, np.ndarray]]:
        """Advance all rows; ``info`` holds ``success`` and ``death``. The next step overwrites what it returns.

        Raises:
            SegarError: an action is not finite.
        """
        actions = np.asarray(actions, np.float32)
        if not np.isfinite(actions).all():
            raise SegarError(
                f"task {self.starts.task.name}: the player gave actions in step {self.time} that are not finite"
            )
        outcome, self.time = self.outcome, self.time + 1
        self.starts.simulator.act(self.state, self.starts.levels, actions, outcome)
        info = {"success": outcome.success, "death": outcome.death}
        return self.state.values, outcome.reward, outcome.terminated, self.time >= self.limits, info

    def shrink(self, kept: np.ndarray) -> np.ndarray:
        """Drop all rows but ``kept``, bool ``(n,)``; return the states of these."""
        self.limits, self.episodes = self.limits[kept], self.episodes[kept]
        self._keep(self.state, kept)
        return self.state.values

    def _keep(self, state: State, rows: np.ndarray) -> None:
        """Go on from copies of these rows of a state."""
        self.state = State(**{name: array[rows] for name, array in vars(state).items()})
        self.outcome = StepResult.empty(len(self.state.values))


def play_forks(
    starts: Starts,
    rows: np.ndarray,
    player: Policy,
    limits: np.ndarray | None = None,
    keys: np.ndarray | None = None,
) -> Episodes:
    """One episode by ``player`` from the start of each level in ``rows``; arguments as of :class:`ForkedEpisodes`.

    Args:
        player: observes states, and begins with :class:`ForkedEpisodes`.
        limits: the task's time limit where it is None.

    Raises:
        SegarError: the player gives an action that is not finite.
    """
    n, task = len(rows), starts.task
    low, high = np.array(task.action_low, np.float32), np.array(task.action_high, np.float32)
    forks = ForkedEpisodes(starts, rows, np.full(n, task.max_steps) if limits is None else limits, keys)
    values = forks.state.values.copy()
    solved, died = np.zeros(n, np.bool_), np.zeros(n, np.bool_)
    steps, returns, last = np.zeros(n, np.int64), np.zeros(n), np.zeros(n)
    actions = np.zeros((n, task.max_steps, len(low)), np.float32)
    for now in play(forks, player, (forks.state.values, {})):
        if now.time == 0:
            continue
        on, over = now.episodes[now.played], now.episodes[now.ended]
        actions[on, now.time - 1] = np.clip(now.action[now.played], low, high)
        steps[on] = now.time
        returns[on] += now.reward[now.played]
        last[on] = now.reward[now.played]
        solved[over], died[over] = now.info["success"][now.ended], now.info["death"][now.ended]
        values[over] = now.observation[now.ended]
    return Episodes(solved, died, steps, returns, last, actions, values)


def trace(starts: Starts, rows: np.ndarray, actions: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """All states that these actions lead through, from the starts of the levels in ``rows``.

    Args:
        actions: float ``(len(rows), steps, action size)``.

    Returns:
        float64 ``(len(rows), steps + 1, entities, columns)``, and the step at which each episode ended, int
        ``(len(rows),)``, ``steps + 1`` where it did not. After its end an episode keeps its last state.
    """
    n, length = actions.shape[:2]
    forks = ForkedEpisodes(starts, rows, np.full(n, length))
    states = np.empty((n, length + 1, *forks.state.values.shape[1:]))
    states[:, 0] = forks.state.values
    ends = np.full(n, length + 1)
    for now in play(forks, OpenLoop(actions), (forks.state.values, {})):
        states[now.episodes[now.played], now.time] = now.observation[now.played]
        states[now.episodes[now.ended], now.time + 1 :] = now.observation[now.ended, None]
        ends[now.episodes[now.played & now.terminated]] = now.time
    return states, ends


class OpenLoop:
    """The player that plays ``actions[episode, step]`` of forked episodes; float ``(n, steps, action size)``."""

    def __init__(self, actions: np.ndarray) -> None:
        self.actions = actions

    def begin(self, forks: ForkedEpisodes) -> None:
        self.forks = forks

    def __call__(self, values: np.ndarray) -> np.ndarray:
        return self.actions[self.forks.episodes, self.forks.time]


def scripted(starts: Starts) -> Policy | None:
    """The scripted player of the task, which observes states; None where it has none."""
    task, layout = starts.task, starts.levels.layout
    if task.demo_actions is None:
        return None
    return lambda values: task.scripted_actions(Factors(layout, layout.named(values)))


def uniform_actions(task: Task, n: int, steps: int, rng: np.random.Generator) -> np.ndarray:
    """Actions drawn uniformly from the task's range, float32 ``(n, steps, action size)``."""
    low, high = np.array(task.action_low), np.array(task.action_high)
    return (low + (high - low) * rng.random((n, steps, len(low)))).astype(np.float32)
