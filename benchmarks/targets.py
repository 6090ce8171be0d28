"""Kernels of other targets beside the processor's own: WebAssembly in a runtime that compiles ahead, on one thread."""

from __future__ import annotations

import time
from collections.abc import Iterator
from functools import partial

import numpy as np

import segar
from benchmarks.measure import Row, in_turns
from tests.segar.engine.targets.twin import Twin

FAMILIES = ("empty-hard", "objectsx3-hard", "tilesx3-hard", "puttputt", "billiards", "invisiball")
LEVELS, SUB_STEPS = 100, 300


def targets(repeats: int) -> Iterator[Row]:
    """Sub-steps from the starts of levels: seconds of the processor's kernel by seconds of the wasm module."""
    for name in FAMILIES:
        levels = segar.family(name).sample(LEVELS, seed=0)
        env = segar.envs.VectorEnv(levels, LEVELS, seed=0, autoreset_mode="Disabled")
        env.reset(options={"levels": np.arange(LEVELS)})
        twin = Twin(env, "wasm")
        native, wasm = in_turns([partial(native_steps, env), partial(wasm_steps, twin)], 5 * repeats, time.process_time)
        note = f"{len(twin.kernel.code) / 1000:.0f} kB"
        yield Row(f"wasm {name}", [s / SUB_STEPS / LEVELS * 1e9 for s in wasm], "ns", note=f"a sub-step; {note}")
        yield Row("  native / wasm", [a / b for a, b in zip(native, wasm, strict=True)], "x", at_least=0.7)


def native_steps(env: segar.envs.VectorEnv) -> None:
    """So many sub-steps from the starts."""
    env._now.state.values[:] = env.levels.values
    env.simulator.step(env._now.state, env.levels, SUB_STEPS)


def wasm_steps(twin: Twin) -> None:
    """The same in the module."""
    twin.machine["state_values"][...] = twin.env.levels.values
    numbers = {"sub_steps": SUB_STEPS, "with_task": 0}
    twin.machine.call(twin.calls.step, {}, twin.sizes, numbers, LEVELS)
