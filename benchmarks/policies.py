"""Decisions by a policy of somebody else's, which acts in a process of its own."""

from __future__ import annotations

import time
from collections.abc import Iterator

import numpy as np

import segar
from benchmarks.measure import Row
from segar.experiments.benchmarking.policy_process import ROWS, PolicyProcess
from segar.suites import suite

BATCHES = 200


def constant(side: object, seed: int):
    """A trivial policy."""
    return lambda observations: np.full((len(observations), 2), 0.1, np.float32)


def policies(repeats: int) -> Iterator[Row]:
    """Decisions in a second, 512 at a time, without the steps of environments."""
    of = suite("place-few-v1")
    env = segar.envs.VectorEnv(of.test_levels[np.arange(ROWS) % len(of.test_levels)], ROWS, seed=0, task=of.task)
    observations, _ = env.reset(seed=0)
    rates = []
    with PolicyProcess("benchmarks.policies:constant", of, 1, {"task": of.task}) as policy:
        policy.begin(env)
        for _ in range(repeats):
            began = time.perf_counter()
            for _ in range(BATCHES):
                policy(observations)
            rates.append(ROWS * BATCHES / (time.perf_counter() - began) / 1e3)
    yield Row("decisions by a policy in a process of its own", rates, "k/s", at_least=100)
