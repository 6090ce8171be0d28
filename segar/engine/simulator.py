"""The simulator: a world on a layout, compiled, stepping a batch of states."""

from __future__ import annotations

import operator
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from segar.engine.compiler.kernel import KernelSource, generate
from segar.engine.compiler.kernel_cache import load_module
from segar.engine.runtime.gather import Reads, no_reads
from segar.engine.runtime.ledger import dismiss, make_ledger
from segar.errors import ConflictError, SegarError
from segar.language import Layout, Task, WorldRules, default_task
from segar.support import Team

if TYPE_CHECKING:
    from segar.levels import Levels

PART = 32  # environments that a thread takes at a time


@dataclass
class State:
    """A batch of environment states; arrays lead with the environment.

    Attributes:
        values: float64 ``(num_envs, entities, columns)``.
        level: int64 ``(num_envs,)``, index in the level set.
        key: uint64 ``(num_envs,)``, key of the randomness in rules.
        tick: int64 ``(num_envs,)``, sub-steps since the episode began.
        contacts: int64 ``(num_envs,)``, contacts since the episode began.
        gave_up: int64 ``(num_envs,)``, sub-steps whose time ran out in contacts.
    """

    values: np.ndarray
    level: np.ndarray
    key: np.ndarray
    tick: np.ndarray
    contacts: np.ndarray
    gave_up: np.ndarray

    @classmethod
    def empty(cls, num_envs: int, layout: Layout) -> State:
        return cls(
            values=np.full((num_envs, len(layout.slots), layout.width), np.nan),
            level=np.zeros(num_envs, np.int64),
            key=np.zeros(num_envs, np.uint64),
            tick=np.zeros(num_envs, np.int64),
            contacts=np.zeros(num_envs, np.int64),
            gave_up=np.zeros(num_envs, np.int64),
        )

    def copy(self) -> State:
        return replace(self, **{name: array.copy() for name, array in vars(self).items()})


@dataclass
class Outcome:
    """What a task says after a step; arrays of length ``num_envs``, overwritten by the next step."""

    reward: np.ndarray
    terminated: np.ndarray
    success: np.ndarray
    death: np.ndarray

    @classmethod
    def empty(cls, num_envs: int) -> Outcome:
        return cls(np.zeros(num_envs), *(np.zeros(num_envs, np.bool_) for _ in range(3)))


@dataclass(frozen=True)
class _Statics:
    """Static arrays of a level set in the order of the kernel's arguments."""

    bits: np.ndarray
    kind: np.ndarray
    count: np.ndarray
    vertex: np.ndarray
    hull_radius: np.ndarray
    parameters: np.ndarray


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
        self._module = load_module(self.source.text)
        self._statics: dict[int, tuple[Any, _Statics]] = {}
        self._call: _Call | None = None
        self.team = Team(self.num_threads)

    def step(self, state: State, levels: Levels, n: int = 1) -> None:
        """Advance every environment by ``n`` sub-steps, in place, without a task."""
        num_envs = len(state.level)
        self._run(state, levels, n, None, Outcome.empty(num_envs))

    def act(
        self,
        state: State,
        levels: Levels,
        actions: np.ndarray,
        outcome: Outcome,
        reads: Reads | None = None,
        seen: np.ndarray | None = None,
    ) -> None:
        """One environment step of all environments, in place; ``outcome`` receives what the task says.

        Args:
            actions: float32 ``(num_envs, action size)``, finite; clipped to the task's range.
            reads: what is written to ``seen`` (float32 ``(num_envs, ...)``, contiguous) about the states after the
                step, while they are at hand.

        Raises:
            ConflictError: rules contradict each other in some state; the message names the environment.
        """
        self._run(state, levels, self.task.sub_steps, actions, outcome, reads, seen)

    def _run(
        self,
        state: State,
        levels: Levels,
        n: int,
        actions: np.ndarray | None,
        outcome: Outcome,
        reads: Reads | None = None,
        seen: np.ndarray | None = None,
    ) -> None:
        given = (*vars(state).values(), *vars(outcome).values(), levels, reads)
        asked = (n, actions is not None, 0 if seen is None else seen.size // len(seen))
        call = self._call
        if call is None or call.asked != asked or not all(map(operator.is_, call.given, given)):
            call = self._call = _Call(self, given, asked)
        if actions is not None:
            call.actions[:] = actions
        call.run(seen)
        if np.count_nonzero(call.errors):
            errors = call.errors.copy()
            call.errors[:] = 0
            self._raise_conflict(errors)

    def _raise_conflict(self, err: np.ndarray) -> None:
        env = int(np.flatnonzero(err[:, 0])[0])
        _, slot, column, first, second = err[env]
        factor = next(f for f, c in self.layout.columns.items() if c <= column < c + f.width)
        rules = self.source.rules
        raise ConflictError(
            f"environment {env}: {rules[first].where} and {rules[second].where} set {factor.__name__} of"
            f" '{self.layout.slots[slot].name}' to different values, and neither is more specific; give one a priority"
        )

    def _static_arrays(self, levels: Levels) -> _Statics:
        key = id(levels)
        if key not in self._statics or self._statics[key][0] is not levels:
            if levels.layout != self.layout:
                raise SegarError("these levels belong to another distribution than the simulator was built for")
            radii = np.sqrt((levels.vertices**2).sum(-1)).max(-1, initial=0.0)
            vertices = levels.vertices
            if vertices.shape[2] == 0:
                vertices = np.zeros((*vertices.shape[:2], 1, 2))
            statics = _Statics(
                bits=self.source.type_masks[levels.types],
                kind=np.ascontiguousarray(levels.shape_kind, np.int8),
                count=np.ascontiguousarray(levels.vertex_count, np.int16),
                vertex=np.ascontiguousarray(vertices),
                hull_radius=np.ascontiguousarray(radii),
                parameters=np.ascontiguousarray(levels.parameters),
            )
            self._statics = {key: (levels, statics)}
        return self._statics[key][1]


class _Call:
    """A call of the kernel on certain arrays: what it needs beside them lies ready for the next step.

    Args:
        given: arrays of the state and of the outcome, levels, and what is read of the state or None.
        asked: sub-steps, whether the task takes part, numbers that are seen per environment.
    """

    def __init__(self, simulator: Simulator, given: tuple[Any, ...], asked: tuple[int, bool, int]) -> None:
        self.given, self.asked = given, asked
        *arrays, levels, reads = given
        n, with_task, places = asked
        values, level, key, tick, contacts, gave_up, *outcome = arrays
        num_envs, entities, width = values.shape
        size, list_length = len(simulator.task.action_low), simulator.source.list_length
        s, rows, table = simulator._static_arrays(levels), np.arange(num_envs), reads or no_reads()
        self._advance = simulator._module.advance
        self._ledger = make_ledger(-(-num_envs // PART))
        self._sheet = np.zeros(1, np.int64)  # address of what is seen
        self._team = simulator.team if num_envs > PART else None
        self.actions = np.zeros((num_envs, size), np.float32)
        self.errors = np.zeros((num_envs, 5), np.int64)

        def bind() -> tuple[Any, ...]:
            scratch = (
                np.zeros((entities, width)),
                np.zeros((entities, 2)),
                np.zeros(size),
                np.zeros(list_length, np.int64),
            )
            return (
                PART, n, with_task, values, level, s.bits, s.kind, s.count, s.vertex, s.hull_radius, s.parameters,
                self.actions, key, tick, *outcome, contacts, gave_up, self.errors, rows, table, places, self._sheet,
                *scratch,
            )  # fmt: skip

        self._bind, self._mine = bind, bind()

    def run(self, seen: np.ndarray | None) -> None:
        """One call, by all threads."""
        if seen is not None:
            assert seen.flags.c_contiguous and seen.dtype == np.float32 and len(seen) == len(self.errors)
            self._sheet[0] = seen.ctypes.data
        if self._team is None:
            self.do(True)
        else:
            self._team.do(self)

    def do(self, owns: bool) -> None:
        """See :class:`segar.support.threads.Work`."""
        self._advance(self._ledger, owns, *(self._mine if owns else self._bind()))

    def dismiss(self) -> None:
        """See :class:`segar.support.threads.Work`."""
        dismiss(self._ledger)
