"""The simulator: a world on a layout, compiled, stepping a batch of states."""

import operator
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from segar.engine.batch import LevelArrays, State, StepResult
from segar.engine.compiler.kernel import ARGUMENTS, CONFLICT, STATE_NOT_FINITE, KernelSource, generate
from segar.engine.compiler.running_kernel import running_kernel
from segar.engine.not_finite import reward_not_finite, state_not_finite
from segar.engine.runtime.gather import Reads, no_reads
from segar.errors import ConflictError, RuleError, SegarError
from segar.language import Layout, Task, WorldRules, default_task
from segar.levels import Levels, check_crossings, check_levels, hull_radii
from segar.support import Team, read_only_view

PART = 32  # environments that a thread takes at a time


@dataclass
class Simulator:
    """Steps batches of states of one layout.

    Args:
        world: rules.
        layout: slots and columns of the level distribution.
        task: action, reward and termination; PuttPutt where it is None.
        num_threads: threads over the batch; results do not depend on it.

    Raises:
        RuleError, ConflictError: the world does not fit the layout or contradicts itself.
    """

    world: WorldRules
    layout: Layout
    task: Task = field(default_factory=default_task)
    num_threads: int = 1

    def __post_init__(self) -> None:
        if self.num_threads < 1:
            raise SegarError(f"num_threads must be at least 1, not {self.num_threads}")
        self.source: KernelSource = generate(self.layout, self.world, self.task.functions())
        self.kernel = running_kernel(self.source)
        self._level_arrays: tuple[Levels, LevelArrays] | None = None
        self._call: _Call | None = None
        self.team = Team(self.num_threads)

    def step(self, state: State, levels: Levels, n: int = 1) -> None:
        """Advance every environment by ``n`` sub-steps, in place, without a task.

        Raises:
            ConflictError, RuleError: see :meth:`act`.
        """
        self.act(state, levels, None, StepResult.empty(len(state.level)), sub_steps=n)

    def act(
        self,
        state: State,
        levels: Levels,
        actions: np.ndarray | None,
        result: StepResult,
        reads: Reads | None = None,
        seen: np.ndarray | None = None,
        sub_steps: int | None = None,
    ) -> None:
        """One environment step of all environments, in place.

        Args:
            actions: float32 ``(num_envs, action size)``, finite; clipped to the task's range. The task takes no part where
                it is None.
            result: receives the reward, and whether the episode is over, with success or by death.
            reads: what is written to ``seen`` (float32 ``(num_envs, ...)``, contiguous) about the states after the step.
            sub_steps: how many; the task's where it is None.

        Raises:
            ConflictError: rules contradict each other in some state; the message names the environment.
            RuleError: a number of a state, or a reward, is not finite after the step; the message names the environment,
                the entity, the factor and the rules that change it. All environments have been stepped nevertheless.
        """
        arrays = (*vars(state).values(), *vars(result).values(), levels, reads)
        n = self.task.sub_steps if sub_steps is None else sub_steps
        options = (n, actions is not None, 0 if seen is None else seen.size // len(seen))
        call = self._call
        if call is None or call.options != options or not all(map(operator.is_, call.arrays, arrays)):
            call = self._call = _Call(arrays, options, self, state, levels, result, reads or no_reads())
        if actions is not None:
            call.actions[:] = actions
        call.run(seen)
        if np.count_nonzero(call.errors):
            errors = call.errors.copy()
            call.errors[:] = 0
            self.raise_errors(errors, state, levels, result)

    def raise_errors(self, errors: np.ndarray, state: State, levels: Levels, result: StepResult) -> None:
        """Say what is wrong after a step, as :meth:`act` does.

        Args:
            errors: int64 ``(num_envs, 5)``, not all 0, as a kernel wrote them.

        Raises:
            ConflictError, RuleError: see :meth:`act`.
        """
        found = errors[:, 0]
        if (found == CONFLICT).any():
            raise self._conflict(int(np.flatnonzero(found == CONFLICT)[0]), errors)
        env, others = int(np.flatnonzero(found)[0]), np.count_nonzero(found) - 1
        level = int(state.level[env])
        if found[env] == STATE_NOT_FINITE:
            said = state_not_finite(env, levels, level, state.values[env], self.source.rules)
        else:
            said = reward_not_finite(env, level, result.reward[env], self.task.functions().reward)
        raise RuleError(said + (f". The same holds for {others} other environments" if others else ""))

    def _conflict(self, env: int, errors: np.ndarray) -> ConflictError:
        _, slot, column, first, second = errors[env]
        factor = next(f for f, c in self.layout.columns.items() if c <= column < c + f.width)
        rules = self.source.rules
        return ConflictError(
            f"environment {env}: {rules[first].where} and {rules[second].where} set {factor.__name__} of"
            f" '{self.layout.slots[slot].name}' to different values, and neither is more specific; give one a priority"
        )

    def arrays_of(self, levels: Levels) -> LevelArrays:
        """The arrays of a level set; those of the last one are kept."""
        if self._level_arrays is None or self._level_arrays[0] is not levels:
            if levels.layout != self.layout:
                raise SegarError("these levels belong to another distribution than the simulator was built for")
            check_levels(levels)
            check_crossings(levels, self.world, self.task.sub_steps)
            vertices, radii = levels.vertices, hull_radii(levels)
            if vertices.shape[2] == 0:
                vertices = np.zeros((*vertices.shape[:2], 1, 2))
            arrays = LevelArrays(
                bits=read_only_view(self.source.type_masks[levels.types]),
                kind=read_only_view(levels.shape_kind, np.int8),
                count=read_only_view(levels.vertex_count, np.int16),
                vertex=read_only_view(vertices),
                hull_radius=read_only_view(radii),
                parameters=read_only_view(levels.parameters),
            )
            self._level_arrays = levels, arrays
        return self._level_arrays[1]


class _Call:
    """A call of the kernel on certain arrays, with all of its arguments ready for the next step.

    Args:
        arrays: what the call is for: it serves as long as the next step has the same objects.
        options: sub-steps, whether the task takes part, numbers that are seen per environment; likewise.
    """

    def __init__(
        self,
        arrays: tuple[Any, ...],
        options: tuple[int, bool, int],
        simulator: Simulator,
        state: State,
        levels: Levels,
        result: StepResult,
        reads: Reads,
    ) -> None:
        self.arrays, self.options = arrays, options
        num_envs, entities, width = state.values.shape
        action_size, self._list_length = len(simulator.task.action_low), simulator.source.list_length
        self._kernel, self._steps = simulator.kernel, num_envs * options[0]
        self._ledger = self._kernel.module.make_ledger(-(-num_envs // PART))
        self._sheet = self._kernel.module.make_sheet()
        self._team = simulator.team if num_envs > PART else None
        self._scratch = {"W": (entities, width), "U": (entities, 2), "A": action_size}
        self.actions = np.zeros((num_envs, action_size), np.float32)
        self.errors = np.zeros((num_envs, 5), np.int64)
        n, with_task, places = options
        self._arguments = {
            **{"part_length": PART, "sub_steps": n, "with_task": with_task, "places": places, "reads": reads},
            **{"actions": self.actions, "errors": self.errors, "rows": np.arange(num_envs)},
            **{f"state_{name}": array for name, array in vars(state).items()},
            **{f"level_{name}": array for name, array in vars(simulator.arrays_of(levels)).items()},
            **{f"result_{name}": array for name, array in vars(result).items()},
        }
        self._mine = self._bind()

    def _bind(self) -> tuple[Any, ...]:
        """All arguments but those of threads, with scratch of their own."""
        scratch = {name: np.zeros(shape) for name, shape in self._scratch.items()}
        arguments = {**self._arguments, **scratch, "L": np.zeros(self._list_length, np.int64)}
        return tuple(arguments[name] for name in ARGUMENTS)

    def run(self, seen: np.ndarray | None) -> None:
        """One call, by all threads."""
        if seen is not None:
            assert seen.flags.c_contiguous and seen.dtype == np.float32 and len(seen) == len(self.errors)
            self._sheet = self._kernel.module.sheet_with(self._sheet, seen)
        if self._kernel.is_python and self._runs_as_python(seen):
            return
        if self._team is None:
            self.do(True)
        else:
            self._team.do(self)

    def _runs_as_python(self, seen: np.ndarray | None) -> bool:
        """:meth:`RunningKernel.steps_as_python`; what a call that ends in an exception has written is taken back."""
        written = [a for name, a in self._arguments.items() if name.startswith(("state_", "result_", "errors"))]
        written += [] if seen is None else [seen]
        before = [array.copy() for array in written]
        try:
            return self._kernel.steps_as_python((self._ledger, True, self._sheet, *self._mine), self._steps)
        except BaseException:
            for array, content in zip(written, before, strict=True):
                array[...] = content
            raise

    def do(self, owns: bool) -> None:
        """Take parts of the batch; see :class:`segar.support.threads.Work`."""
        self._kernel.module.advance(self._ledger, owns, self._sheet, *(self._mine if owns else self._bind()))

    def dismiss(self) -> None:
        """Make waiting threads leave; see :class:`segar.support.threads.Work`."""
        self._kernel.module.dismiss(self._ledger)
