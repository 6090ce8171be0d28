"""Collecting while learning: a thread collects the next rollout with the weights as they are, while they are learned on.

Rollouts then come from a policy that is one update older than the one that learns. What is learned on has that policy's
own log-probabilities and values, so the loss stays PPO's. It pays where networks compute on a GPU and environments on the
processor.
"""

from __future__ import annotations

import copy
from collections.abc import Mapping
from concurrent.futures import Executor, Future, ThreadPoolExecutor
from contextlib import nullcontext
from typing import Any

import torch
from torch import Tensor

from experiments.collection.collector import Collected, Collector
from segar.envs import VectorEnv


class CollectorAhead:
    """As :class:`experiments.collection.collector.Collector`, one rollout ahead of the learner.

    Args:
        env: steps of its own; nobody else may step it.
        policy: a module that is a :class:`experiments.collection.collector.StepPolicy`; a copy of it acts.
        num_steps: of each environment, per collection.
        device: where policy and rollouts live. On a GPU the collection has a stream of its own.
        executor: who collects; left out, a thread.
    """

    def __init__(
        self, env: VectorEnv, policy: Any, num_steps: int, device: torch.device, executor: Executor | None = None
    ) -> None:
        self.policy = policy
        # Without gradients also because autocast would share its casts of the weights between threads.
        self.behaviour = copy.deepcopy(policy).requires_grad_(False)
        self.collector = Collector(env, self.behaviour, num_steps, device, storages=2)
        self.executor = executor or ThreadPoolExecutor(1, thread_name_prefix="collect")
        self.stream = torch.cuda.Stream(device) if device.type == "cuda" else None
        self.pending: Future[Collected] | None = None
        self.before: dict[str, Any] = {}  # what the pending collection began with, beside the weights that act

    def collect(self, rng: torch.Generator, more: bool) -> Collected:
        """The next rollout; the one after it is begun if ``more`` are wanted. The noise of actions comes from ``rng``."""
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
        """What the pending collection began with, from which it is collected again; else the running episodes."""
        if self.pending is None:
            return self.collector.state_dict()
        return {**self.before, "behaviour": self.behaviour.state_dict()}

    def load_state_dict(self, state: Mapping[str, Any]) -> None:
        """Goes on from ``state``."""
        if self.pending is not None:
            self.pending.result()
            self.pending = None
        self.collector.load_state_dict(state)
        if "noise" in state:
            self.behaviour.load_state_dict(state["behaviour"])
            self._begin(state["noise"])
