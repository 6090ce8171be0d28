"""A network that plays: a policy whose actions are the same bits on every processor."""

import math
from typing import Any, Protocol

import numpy as np

from segar.engine import Call, Given, Rows, Scratch, call_of
from segar.errors import SegarError
from segar.policies.kernels import ROWS, TILE, act, decide, forward
from segar.policies.network import Network
from segar.support import Team

SCRATCH = 2**18  # float32 numbers that the environments of a block share, about what a processor's cache holds
FEWEST, MOST = 4, 64  # environments of a block


class Environments(Protocol):
    """What a policy reads of a :class:`segar.envs.VectorEnv` when episodes start."""

    num_envs: int
    single_action_space: Any

    def state(self) -> Any:
        """A :class:`segar.envs.Snapshot`."""


class NetworkPolicy:
    """Actions for observations, by a network; what :func:`segar.evaluate_policy` plays.

    The actions of an environment do not depend on the other environments of a batch, on the number of threads, or on
    the processor. A policy that samples draws by the key of the running episode, which the seed of the environment
    decides, and by the step. What a network remembers is emptied by :meth:`begin`, and not where an environment starts
    another episode by itself.

    Args:
        network: what computes.
        sampled: whether actions are drawn from the policy's distribution; otherwise they are those without noise.
        unit_actions: whether actions lie in [-1, 1], as the option of :class:`segar.envs.VectorEnv` says; otherwise in
            the network's range of actions.
        num_threads: threads over the batch.
    """

    def __init__(
        self, network: Network, *, sampled: bool = False, unit_actions: bool = False, num_threads: int = 1
    ) -> None:
        self.network, self.sampled, self.unit_actions = network, sampled, unit_actions
        ones = np.ones(network.actions, np.float32)
        low, high = (np.array(bounds, np.float32) for bounds in (network.action_low, network.action_high))
        self._low, self._high = (-ones, ones) if unit_actions else (low, high)
        self._center, self._half_range = (self._low + self._high) / 2, (self._high - self._low) / 2
        self._pass = network.forward_pass(sampled)
        self._remembers = sampled or self._pass.memory_width > 0
        self._block = min(max(SCRATCH // self._pass.width, FEWEST), MOST)
        self._team = Team(num_threads)
        self._start(0)

    def begin(self, env: Environments) -> None:
        """Forget the past, because episodes start in ``env``.

        Raises:
            SegarError: the actions of ``env`` have another number of components, or another range.
        """
        space = env.single_action_space
        if space.shape != self._low.shape or (space.low != self._low).any() or (space.high != self._high).any():
            raise SegarError(
                f"the policy acts from {self._low.tolist()} to {self._high.tolist()}, and the environment takes actions"
                f" from {space.low.tolist()} to {space.high.tolist()}. Where the environment has unit_actions=True, say"
                " NetworkPolicy(..., unit_actions=True), too"
            )
        self._start(env.num_envs)
        if self.sampled:
            self._keys[:] = env.state().state.key

    def __call__(self, observations: np.ndarray) -> np.ndarray:
        """Actions float32 ``(n, components)`` of the next step, for observations ``(n, ...)``.

        Raises:
            SegarError: observations have another shape or dtype than the network reads, or are not of the environments
                in which episodes began.
        """
        rows = self._checked(observations)
        n = len(rows)
        if not self._remembers and n != len(self._keys):
            self._start(n)
        actions = np.empty((n, self.network.actions), np.float32)
        blocks = -(-n // self._block)
        self._team.do_range(lambda start, stop: self._act(rows, actions, start, stop), blocks)
        return actions

    def act(self, observation: np.ndarray) -> np.ndarray:
        """The action float32 ``(components,)`` for one observation; raises as a call with many, of one environment."""
        return self(np.asarray(observation)[None])[0]

    def call(self) -> Call:
        """What a call of the policy does, for other targets; see :func:`segar.engine.build_kernel`.

        The caller gives ``observations`` ``(envs, numbers)``, ``memory`` float32 and ``scratch`` float32 ``(envs, ...)``, zero
        when episodes start, ``keys`` uint64 and ``steps`` int64 ``(envs,)`` of the episodes, and ``actions`` float32 ``(envs,
        components)`` and ``values`` float32 ``(envs,)``, which are written; values by networks that have them.
        """
        network, envs = self.network, ("envs",)
        made = network.forward_pass(self.sampled, valued=True)
        mean, log_std = made.outputs[0], made.outputs[1] if self.sampled else 0
        value = -1 if network.value is None else made.outputs[-1]
        observations = Given(np.dtype(network.dtype).name, (*envs, math.prod(network.observation_shape)))
        memory, scratch, actions = (
            Given("float32", (*envs, width)) for width in (made.memory_width, made.width, network.actions)
        )
        arguments = [
            *(Rows(), made.table, made.places, made.floats, observations, memory, scratch),
            *(made.width, Scratch(np.float32, ROWS * TILE), mean, log_std, *network.log_std_range, self._center),
            *(self._half_range, Given("uint64", envs), Given("int64", envs), self.sampled, actions),
            *(value, Given("float32", envs)),
        ]
        return call_of("decide", decide, arguments, {})

    def _start(self, n: int) -> None:
        """Arrays of what is remembered from step to step."""
        self._memory = np.zeros((n, self._pass.memory_width), np.float32)
        self._keys, self._steps = np.zeros(n, np.uint64), np.zeros(n, np.int64)

    def _checked(self, observations: np.ndarray) -> np.ndarray:
        """Observations as ``[n, number]``."""
        shape, dtype = self.network.observation_shape, self.network.dtype
        if not isinstance(observations, np.ndarray) or observations.shape[1:] != shape or observations.dtype != dtype:
            given = (
                f"{observations.dtype} of shape {observations.shape}"
                if isinstance(observations, np.ndarray)
                else type(observations).__name__
            )
            raise SegarError(
                f"the network reads observations {dtype} of shape (n, {', '.join(map(str, shape))}), not {given}. Play"
                " it in an environment with the observation that it was trained on"
            )
        if self._remembers and len(observations) != len(self._keys):
            raise SegarError(
                f"the policy {'samples' if self.sampled else 'has a memory'}: call begin(env) where episodes start, and"
                f" then give it the observations of all of its {len(self._keys)} environments, not of"
                f" {len(observations)}"
            )
        return np.ascontiguousarray(observations).reshape(len(observations), -1)

    def _act(self, rows: np.ndarray, actions: np.ndarray, start: int, stop: int) -> None:
        """Write the actions of the environments of some blocks."""
        made, network = self._pass, self.network
        mean, log_std = made.outputs if self.sampled else (*made.outputs, 0)
        scratch, sums = np.empty(self._block * made.width, np.float32), np.empty(ROWS * TILE, np.float32)
        for first in range(start * self._block, min(stop * self._block, len(rows)), self._block):
            count = min(self._block, len(rows) - first)
            forward(made.table, made.places, made.floats, rows, self._memory, scratch, made.width, sums, first, count)
            act(
                scratch, made.width, mean, log_std, *network.log_std_range, self._center, self._half_range, self._keys,
                self._steps, self.sampled, actions, first, count,
            )  # fmt: skip
