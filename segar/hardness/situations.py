"""Situations: initial states and the actions that follow, in which worlds are rolled out side by side."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from segar.engine import State, StepResult
from segar.errors import LevelError, SegarError
from segar.hardness.planner import BATCH
from segar.hardness.rollouts import Starts, make_starts, uniform_actions
from segar.language import Factor, Task
from segar.levels import Levels, checks
from segar.metrics import Outcomes, Readings, Spread, readings_of
from segar.support import is_whole
from segar.tasks import task_of

HORIZONS = (1, 5, 20)  # steps; 0.05, 0.25 and 1 second in the built-in tasks
OTHER_CHANCE = 1  # added to the seed for random numbers that are independent of the first ones


@dataclass(frozen=True, eq=False)
class Situations:
    """Initial states with the actions that follow; :func:`make_situations` makes them.

    Attributes:
        states: levels, of which the entities count, and neither the rules nor the world parameters.
        task: what an action does. How it rewards and when it ends an episode does not matter here.
        actions: float32 ``(situations, plays, steps, action size)``; in play 0 nothing is done.
        horizons: the steps after which states are compared.
        readings: which numbers of a state count, and in which units.
        seed: of the randomness in rules; situation i has the same random numbers in all worlds.
        num_threads: of the roll-outs; results do not depend on it.
    """

    states: Levels
    task: Task
    actions: np.ndarray
    horizons: tuple[int, ...]
    readings: Readings
    seed: int = 0
    num_threads: int = 1

    def __len__(self) -> int:
        return len(self.states)

    def outcomes(self, levels: Levels, other_chance: bool = False) -> Outcomes:
        """What becomes of these situations under the rules and the world parameters of each level.

        All distinct rule sets of the levels are rolled out in batches of one kernel. The result takes 8 bytes for each rule
        set, situation, play, horizon and number of a state. The end of an episode does not end a
        roll-out: it belongs to the task, and this compares worlds. A body that has died stays where it is.

        Args:
            levels: in the same slots as the states; their entities do not count.
            other_chance: whether rules draw other random numbers than without it.

        Raises:
            LevelError: the levels have other entities than the situations.
        """
        checks.require_levels("outcomes", levels)
        if levels.layout.slots != self.states.layout.slots:
            raise LevelError(
                f"outcomes: the levels have the entities {', '.join(levels.layout.names)}, and the situations"
                f" {', '.join(self.states.layout.names)}; make situations of levels of the same numbers and types"
            )
        rows, of_level = np.unique(levels.parameters, axis=0, return_inverse=True)
        first = self._transplanted(levels, rows[:1])
        starts = make_starts(first, self.task, self.seed + OTHER_CHANCE * other_chance, self.num_threads)
        block = max(1, BATCH // (len(self) * self.actions.shape[1]))
        found = [self._roll_out(levels, rows[at : at + block], starts) for at in range(0, len(rows), block)]
        is_random = starts.simulator.source.draws
        return Outcomes(np.concatenate(found), of_level.reshape(-1), self.horizons, self.readings, is_random)

    def _roll_out(self, levels: Levels, rows: np.ndarray, starts: Starts) -> np.ndarray:
        """The readings under each row of world parameters, float64 ``(rows, situations, plays, horizons, readings)``."""
        there = self._transplanted(levels, rows)
        n, (situations, plays) = len(rows), self.actions.shape[:2]
        level = np.repeat(np.arange(len(there)), plays)
        state = State.empty(len(level), there.layout)
        state.values[:], state.level[:] = there.values[level], level
        state.key[:] = np.tile(np.repeat(starts.state.key, plays), n)
        actions = np.tile(self.actions.reshape(situations * plays, *self.actions.shape[2:]), (n, 1, 1))
        result, found = StepResult.empty(len(level)), []
        for step in range(self.horizons[-1]):
            starts.simulator.act(state, there, actions[:, step], result, sub_steps=0)
            starts.simulator.step(state, there, self.task.sub_steps)
            if step + 1 in self.horizons:
                shaped = state.values.reshape(n, situations, plays, *state.values.shape[1:])
                found.append(self.readings.of(shaped))
        return np.stack(found, axis=3)

    def _transplanted(self, levels: Levels, rows: np.ndarray) -> Levels:
        """The states in the world of the levels, once for each row of world parameters."""
        n, of_state = len(self), np.tile(np.arange(len(self)), len(rows))
        parameters = np.repeat(rows, n, axis=0)
        return replace(self.states[of_state], layout=levels.layout, world=levels.world).with_parameters(parameters)


def make_situations(
    states: Levels,
    task: Task | None = None,
    *,
    rng: np.random.Generator,
    plays: int = 2,
    horizons: Sequence[int] = HORIZONS,
    scale: Spread | None = None,
    factors: Sequence[type[Factor]] | None = None,
    seed: int = 0,
    num_threads: int = 1,
) -> Situations:
    """Situations in which :func:`segar.metrics.dynamics_distance` and its like compare worlds: a state of each level, with
    actions drawn uniformly from the task's range.

    Where bodies start at rest, rules of moving bodies show only in those that actions push. A prior of Velocity in the
    distribution of the states makes all of them move.

    Args:
        states: the initial states, one per level; at least 2, for standard errors.
        task: what actions do; the task of the levels where it is None.
        rng: draws the actions.
        plays: sequences of actions from each state; in the first one nothing is done.
        horizons: the steps after which states are compared.
        scale: ``(entity type, factor)`` to the unit of the factor; by default ``segar.metrics.spread(states)``, the standard
            deviations under the distribution of the states. What has no spread counts in its own unit.
        factors: those that count; by default all numbers but Order and what follows from others (Acceleration, Drag,
            Density). Visible, Alive and Done count, too.
        seed: of the randomness in rules.
        num_threads: of the roll-outs.

    Raises:
        LevelError: fewer than two states, or wrong factors or scale.
        SegarError: no plays, horizons that are no increasing whole numbers from 1 up, or what is no seed or no task.
    """
    checks.require_levels("make_situations", states)
    checks.require_generator("make_situations", rng)
    readings = readings_of("make_situations", states, scale, factors)
    given = list(horizons) if isinstance(horizons, Iterable) else []
    if not given or not all(map(is_whole, (plays, *given))) or plays < 1 or (np.diff((0, *given)) <= 0).any():
        raise SegarError(
            "make_situations needs at least one play, and horizons that are increasing whole numbers from 1 up, not"
            f" {plays!r} and {horizons!r}"
        )
    if not is_whole(seed):
        raise SegarError(f"make_situations: the seed must be a whole number, not {seed!r}")
    if task is not None and not isinstance(task, Task):
        raise SegarError(f"make_situations: task must be a task such as segar.puttputt(), not {task!r}")
    steps, task = tuple(map(int, given)), task or task_of(states)
    drawn = uniform_actions(task, len(states) * plays, steps[-1], rng).reshape(len(states), plays, steps[-1], -1)
    drawn[:, 0] = 0.0
    return Situations(states, task, drawn, steps, readings, seed, num_threads)
