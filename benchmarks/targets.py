"""Kernels of other targets beside the processor's own: WebAssembly in runtimes that compile ahead, on one thread."""

from __future__ import annotations

import hashlib
import json
import shutil
import statistics
import subprocess
import tempfile
import time
from collections.abc import Iterator
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

import segar
from benchmarks.measure import Row, in_turns
from tests.segar.engine.targets.twin import Twin

FAMILIES = ("empty-hard", "objectsx3-hard", "tilesx3-hard", "puttputt", "billiards", "invisiball")
LEVELS, SUB_STEPS = 100, 300
BAR = 0.7  # of the processor's own speed, in the fastest of the runtimes
# V8, which Chromium and Node have, with its optimising compiler alone. A page is compiled by its fast compiler first.
NODE = ("node", "--no-liftoff", "--no-wasm-lazy-compilation")
IN_V8 = """
const { readFileSync } = require("fs");
const [code, image, call] = process.argv.slice(1).map((path) => readFileSync(path));
const { name, given, wide, times } = JSON.parse(call);
const { exports } = new WebAssembly.Instance(new WebAssembly.Module(code));
const missing = image.length - exports.memory.buffer.byteLength;
if (missing > 0) exports.memory.grow(Math.ceil(missing / 65536));
const numbers = given.map((one, k) => (wide[k] ? BigInt(one) : one));
const seconds = [];
for (let k = 0; k < times; k++) {
  new Uint8Array(exports.memory.buffer).set(image);
  const start = process.cpuUsage();
  exports[name](...numbers);
  const { user, system } = process.cpuUsage(start);
  seconds.push((user + system) / 1e6);
}
const bytes = new Uint8Array(exports.memory.buffer, 0, image.length);
console.log(JSON.stringify({ seconds, hash: require("crypto").createHash("sha256").update(bytes).digest("hex") }));
"""


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
        runtimes = {"wasmtime": [a / b for a, b in zip(native, wasm, strict=True)]}
        if shutil.which(NODE[0]):
            runtimes["V8"] = [statistics.median(native) / s for s in v8_steps(twin, 5 * repeats)]
        best = max(runtimes, key=lambda one: statistics.median(runtimes[one]))
        for runtime, ratios in runtimes.items():
            yield Row(f"  native / wasm in {runtime}", ratios, "x", at_least=BAR if runtime == best else None)


def native_steps(env: segar.envs.VectorEnv) -> None:
    """So many sub-steps from the starts."""
    env._episodes.now.state.values[:] = env.levels.values
    env.simulator.step(env._episodes.now.state, env.levels, SUB_STEPS)


def wasm_steps(twin: Twin) -> None:
    """The same in the module."""
    twin.machine["state_values"][...] = twin.env.levels.values
    twin.machine.call(*step_call(twin))


def step_call(twin: Twin) -> tuple[Any, ...]:
    """The call of so many sub-steps of all levels, as a machine takes it."""
    return twin.calls.step, {}, twin.sizes, {"sub_steps": SUB_STEPS, "with_task": 0}, LEVELS


def v8_steps(twin: Twin, times: int) -> list[float]:
    """Seconds of the same in V8, in a copy of the module's memory, which is then equal to the bit."""
    step, machine = step_call(twin), twin.machine
    entry = step[0]
    wide = [False] * (2 + len(entry.sizes)) + [one.dtype == "uint64" and one.shape is None for one in entry.arguments]
    call = {"name": entry.name, "given": [int(one) for one in machine.given(*step)], "wide": wide, "times": times}
    machine["state_values"][...] = twin.env.levels.values
    with tempfile.TemporaryDirectory() as folder:
        files = [Path(folder) / name for name in ("code.wasm", "memory", "call.json")]
        for file, content in zip(files, (twin.kernel.code, machine.image, json.dumps(call).encode()), strict=True):
            file.write_bytes(content)
        done = subprocess.run([*NODE, "-e", IN_V8, *map(str, files)], check=True, capture_output=True, encoding="utf-8")
    found = json.loads(done.stdout)
    wasm_steps(twin)
    assert found["hash"] == hashlib.sha256(machine.image).hexdigest(), "V8 and wasmtime differ"
    return found["seconds"]
