"""The simulator: a world on a layout, compiled, stepping a batch of states."""

from __future__ import annotations

import os
import threading
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field, replace
from itertools import pairwise
from typing import TYPE_CHECKING, Any

import numpy as np

from segar.engine.cache import load_module
from segar.engine.kernel import KernelSource, generate
from segar.engine.layout import Layout
from segar.errors import ConflictError, SegarError
from segar.tasks.puttputt import puttputt
from segar.tasks.task import Task
from segar.world import World

if TYPE_CHECKING:
    from segar.levels import Levels

SMALL_BATCH = 16  # environments per thread below which a second thread costs more than it gives


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

    world: World
    layout: Layout
    task: Task = field(default_factory=puttputt)
    num_threads: int = 1

    def __post_init__(self) -> None:
        if self.num_threads < 1:
            raise SegarError(f"num_threads must be at least 1, not {self.num_threads}")
        self.source: KernelSource = generate(self.layout, self.world, self.task.functions())
        self._module = load_module(self.source.text)
        self._statics: dict[int, tuple[Any, _Statics]] = {}

    def step(self, state: State, levels: Levels, n: int = 1) -> None:
        """Advance every environment by ``n`` sub-steps, in place, without a task."""
        num_envs = len(state.level)
        self._run(state, levels, n, None, Outcome.empty(num_envs))

    def act(self, state: State, levels: Levels, actions: np.ndarray, outcome: Outcome) -> None:
        """One environment step of all environments, in place; ``outcome`` receives what the task says.

        Args:
            actions: float32 ``(num_envs, action size)``, finite; clipped to the task's range.

        Raises:
            ConflictError: rules contradict each other in some state; the message names the environment.
        """
        self._run(state, levels, self.task.sub_steps, actions, outcome)

    def _run(self, state: State, levels: Levels, n: int, actions: np.ndarray | None, outcome: Outcome) -> None:
        s = self._static_arrays(levels)
        num_envs = len(state.level)
        err = np.zeros((num_envs, 5), np.int64)
        with_task = actions is not None
        if actions is None:
            actions = np.zeros((num_envs, len(self.task.action_low)), np.float32)

        def advance(start: int, stop: int) -> None:
            entities, width = state.values.shape[1:]
            scratch = np.zeros((entities, width)), np.zeros((entities, 2)), np.zeros(actions.shape[1])
            lists = np.zeros(self.source.list_length, np.int64)
            self._module.advance(
                start, stop, n, with_task, state.values, state.level, s.bits, s.kind, s.count, s.vertex, s.hull_radius,
                s.parameters, actions, state.key, state.tick, outcome.reward, outcome.terminated, outcome.success,
                outcome.death, state.contacts, state.gave_up, err, *scratch, lists,
            )  # fmt: skip

        run_in_threads(advance, num_envs, self.num_threads)
        if err[:, 0].any():
            self._raise_conflict(err)

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


_pools: dict[int, ThreadPoolExecutor] = {}
_pool_lock = threading.Lock()


def run_in_threads(function: Any, count: int, num_threads: int) -> None:
    """Call ``function(start, stop)`` over equal parts of ``range(count)``, in threads where there is enough to do.

    The kernels release the interpreter lock, so plain threads run them side by side.
    """
    parts = min(num_threads, max(1, count // SMALL_BATCH))
    if parts == 1:
        function(0, count)
        return
    bounds = [count * p // parts for p in range(parts + 1)]
    futures = [_pool(num_threads).submit(function, a, b) for a, b in pairwise(bounds[1:])]
    function(bounds[0], bounds[1])
    for future in futures:
        future.result()


def _pool(num_threads: int) -> ThreadPoolExecutor:
    with _pool_lock:
        if num_threads not in _pools:
            _pools[num_threads] = ThreadPoolExecutor(num_threads - 1, thread_name_prefix="segar")
        return _pools[num_threads]


def _forget_pools() -> None:
    """A forked child has none of its parent's threads: start new ones on first use."""
    global _pool_lock
    _pools.clear()
    _pool_lock = threading.Lock()


os.register_at_fork(after_in_child=_forget_pools)
