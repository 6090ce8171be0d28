"""What becomes of levels under given actions: the states after each step, as the simulator makes them."""

from dataclasses import dataclass, field

import numpy as np

from segar.engine import Simulator, State, StepResult
from segar.envs import world_of
from segar.errors import SegarError
from segar.language import Layout, Task
from segar.levels import Levels


@dataclass(frozen=True, eq=False)
class Trajectories:
    """Episodes that begin with the levels of a set; arrays lead with the level.

    Attributes:
        states: float64 ``(n, steps + 1, entities, columns)``, the first one the level's own.
        ends: int64 ``(n,)``, after how many steps the task was over; ``steps + 1`` where it is not.
        solved: int64 ``(n,)``, after how many steps there was success, not later than the end; ``steps + 1`` where there
            was none.
    """

    states: np.ndarray
    ends: np.ndarray
    solved: np.ndarray

    @property
    def go_on(self) -> np.ndarray:
        """Whether the task was not over within all steps, bool ``(n,)``."""
        return self.ends == self.states.shape[1]


@dataclass
class Player:
    """Plays levels of any layout by given actions, with the bits of :class:`segar.envs.VectorEnv`.

    Args:
        task: what is played.
    """

    task: Task
    _simulators: dict[tuple[Layout, int], Simulator] = field(default_factory=dict)

    def play(self, levels: Levels, actions: np.ndarray) -> Trajectories:
        """One episode on each level; an episode that is over is stepped on.

        Args:
            actions: float ``(n, steps, action size)``, or ``(steps, action size)`` for the same in all levels; those out of
                the task's range are clipped.

        Raises:
            SegarError: the rules or the task draw random numbers, or are not known; or a number of a state gets infinite.
        """
        n, simulator = len(levels), self._simulator(levels)
        actions = np.clip(actions, self.task.action_low, self.task.action_high).astype(np.float32)
        actions = np.broadcast_to(actions, (n, *actions.shape[-2:]))
        steps = actions.shape[1]
        state, result = State.empty(n, levels.layout), StepResult.empty(n)
        state.values[:], state.level[:] = levels.values, np.arange(n)
        states = np.empty((n, steps + 1, *levels.values.shape[1:]))
        states[:, 0] = state.values
        ends, solved = np.full(n, steps + 1), np.full(n, steps + 1)
        for step in range(1, steps + 1):
            simulator.act(state, levels, actions[:, step - 1], result)
            states[:, step] = state.values
            running = ends > steps
            solved[running & result.success & (solved > steps)] = step
            ends[running & result.terminated] = step
        return Trajectories(states, ends, solved)

    def _simulator(self, levels: Levels) -> Simulator:
        world = world_of(levels)
        key = levels.layout, id(levels.world)
        if key not in self._simulators:
            made = Simulator(world, levels.layout, self.task)
            if made.source.draws:
                raise SegarError(
                    f"a rule of {levels!r}, or the task {self.task.name}, draws random numbers, so that nobody can know what"
                    " comes; take rules and a task without segar.random"
                )
            self._simulators[key] = made
        return self._simulators[key]
