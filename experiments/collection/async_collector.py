"""Collecting while learning: a thread collects the next rollout with a copy of the weights while the learner updates them.

A rollout then comes from a policy that is one update older than the one that learns. It holds the log-probabilities and
values of that older policy, so the loss stays PPO's. This is faster where networks run on a GPU and environments on the CPU.
"""

import copy
from collections.abc import Mapping
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import nullcontext
from typing import Any

import torch
from torch import Tensor

from segar.envs import VectorEnv
from segar.experiments.collection.collector import Collected, Collector


class AsyncCollector:
    """A :class:`segar.experiments.collection.collector.Collector` that is one rollout ahead of the learner.

    Args:
        env: only this collector may step it.
        policy: a module that is a :class:`segar.experiments.collection.collector.ActorCritic`; a copy of it acts.
        num_steps: of each environment, per collection.
        device: where policy and rollouts live. On a GPU the collection has a stream of its own.
        joins_trials: as of :class:`segar.experiments.collection.collector.Collector`.
    """

    def __init__(
        self, env: VectorEnv, policy: Any, num_steps: int, device: torch.device, joins_trials: bool = False
    ) -> None:
        self.policy = policy
        # Without gradients also because autocast would share its casts of the weights between threads.
        self.behaviour = copy.deepcopy(policy).requires_grad_(False)
        self.collector = Collector(env, self.behaviour, num_steps, device, joins_trials, storages=2)
        # MKL keeps a number of threads for each thread that calls it, and sums in another order where it is another number.
        self.executor = ThreadPoolExecutor(
            1, "collect", initializer=torch.set_num_threads, initargs=(torch.get_num_threads(),)
        )
        self.stream = torch.cuda.Stream(device) if device.type == "cuda" else None
        self.pending: Future[Collected] | None = None
        # The state in which the pending collection began, without the weights that act.
        self.before: dict[str, Any] = {}

    def collect(self, rng: torch.Generator, more: bool) -> Collected:
        """The next rollout; if ``more`` are wanted, the one after it is begun. ``rng`` draws the noise of actions."""
        pending = self.pending or self._follow(rng)
        collected, self.pending = pending.result(), None
        if more:
            self._follow(rng)
        return collected

    def _follow(self, rng: torch.Generator) -> Future[Collected]:
        """Begins a collection with the learner's weights."""
        self.behaviour.load_state_dict(self.policy.state_dict())
        return self._begin(self.collector.draw_noise(rng))

    def _begin(self, noise: Tensor) -> Future[Collected]:
        self.before = {**self.collector.state_dict(), "noise": noise}
        if self.stream is not None:
            self.stream.wait_stream(torch.cuda.current_stream(self.stream.device))
        self.pending = self.executor.submit(self._collect, noise)
        return self.pending

    def _collect(self, noise: Tensor) -> Collected:
        with nullcontext() if self.stream is None else torch.cuda.stream(self.stream):
            collected = self.collector.collect_with(noise)
        if self.stream is not None:
            self.stream.synchronize()
        return collected

    def state_dict(self) -> dict[str, Any]:
        """The state in which the pending collection began, so that it can be repeated; without one, the running episodes."""
        if self.pending is None:
            return self.collector.state_dict()
        return {**self.before, "behaviour": self.behaviour.state_dict()}

    def load_state_dict(self, state: Mapping[str, Any]) -> None:
        """Continues from ``state``."""
        if self.pending is not None:
            self.pending.result()
            self.pending = None
        self.collector.load_state_dict(state)
        if "noise" in state:
            self.behaviour.load_state_dict(state["behaviour"])
            self._begin(state["noise"])
