"""Environments on a GPU: steps per second of one card, beside one core of the processor. Empty where there is no GPU."""

from __future__ import annotations

import statistics
import time
from collections.abc import Iterator
from typing import Any

import segar
from benchmarks.measure import Row, timed

FAMILIES = ("empty-hard", "objectsx3-hard", "tilesx3-hard")
NUM_ENVS = {"state": (4096, 65536), "rgb": (4096, 16384)}
STEPS = 200  # two episodes: that resets are in the numbers


def gpu(repeats: int) -> Iterator[Row]:
    """Million environment steps per second, observations and resets included; those of one core in the note."""
    import torch

    if not torch.cuda.is_available():
        return
    for family in FAMILIES:
        levels = segar.family(family).sample(1000, seed=0)
        for observation, sizes in NUM_ENVS.items():
            core = rate(levels, 1024, observation, repeats, "cpu", STEPS if observation == "state" else STEPS // 4)[0]
            for num_envs in sizes:
                rates, seconds = rate(levels, num_envs, observation, repeats, "cuda", STEPS)
                note = (
                    f"{num_envs} environments, ready after {seconds:.0f} s; one core does {statistics.median(core):.3g}"
                )
                yield Row(f"{torch.cuda.get_device_name()} {family} {observation}", rates, "M/s", note=note)


def rate(
    levels: Any, num_envs: int, observation: str, repeats: int, device: str, steps: int
) -> tuple[list[float], float]:
    """Million steps per second, and the seconds until the first states were there."""
    import torch

    begun = time.perf_counter()
    env = segar.envs.VectorEnv(levels, num_envs, observation=observation, seed=0, device=device, copy=False)
    env.reset()
    env.state()  # which waits for the GPU
    seconds = time.perf_counter() - begun
    actions = torch.rand(16, num_envs, 2, device=device) * 2 - 1
    given = list(actions if env.runs_on_gpu else actions.numpy())

    def roll() -> None:
        for step in range(steps):
            env.step(given[step % 16])
        if env.runs_on_gpu:
            torch.cuda.synchronize()

    roll()
    return [num_envs * steps / s / 1e6 for s in timed(roll, repeats)], seconds
