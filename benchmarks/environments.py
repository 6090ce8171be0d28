"""What users wait for: environment steps and resets, single and batched, sampling, importing, compiling."""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator

import gymnasium
import numpy as np

import segar
from benchmarks.measure import Row, timed

NUM_ENVS = 1024
STEPS = 100
ENVIRONMENTS = (
    ("empty-hard", "state", 2.4),
    ("objectsx3-hard", "state", 0.4),
    ("tilesx3-hard", "state", None),
    ("empty-hard", "rgb", None),
    ("objectsx3-hard", "rgb", 0.2),
    ("tilesx3-hard", "rgb", None),
)
REFERENCE_2022 = {"empty-hard": 165, "objectsx3-hard": 53, "tilesx3-hard": 85}  # env steps per core-second, pixels


def environments(repeats: int) -> Iterator[Row]:
    """Environment steps per core-second, observations, resets and info included."""
    for family, observation, bar in ENVIRONMENTS:
        env = make_env(family, observation)
        actions = random_actions(16)
        steps = STEPS if observation == "state" else STEPS // 4
        for action in actions[:4]:
            env.step(action)

        def roll(env=env, steps=steps, actions=actions) -> None:
            for step in range(steps):
                env.step(actions[step % len(actions)])

        rates = [NUM_ENVS * steps / s / 1e6 for s in timed(roll, repeats, time.process_time)]
        row = Row(f"VectorEnv {family} {observation}", rates, "M/s", at_least=bar)
        yield Row(**{**vars(row), "note": f"{row.median * 1e6 / REFERENCE_2022[family]:,.0f} x 2022"})


def single(repeats: int) -> Iterator[Row]:
    """One environment through Gymnasium, its resets included."""
    for family in ("empty-hard", "objectsx3-hard"):
        env = gymnasium.make(f"Segar-{family}-state-linear-v0", disable_env_checker=True)
        actions = random_actions(256)[:, 0]
        env.reset(seed=0)

        def roll(env=env, actions=actions) -> None:
            for action in actions:
                _, _, terminated, truncated, _ = env.step(action)
                if terminated or truncated:
                    env.reset()

        roll()
        micros = [s / len(actions) * 1e6 for s in timed(roll, repeats, time.process_time)]
        yield Row(f"Gymnasium {family} state, per step", micros, "µs", at_most=25)


def resets(repeats: int) -> Iterator[Row]:
    """Reset of all environments of a batch."""
    for family, observation, bar in (("empty-hard", "state", 1.0), ("objectsx3-hard", "state", 1.0)):
        env = make_env(family, observation)
        env.reset()
        millis = [s * 1e3 for s in timed(env.reset, 5 * repeats, time.process_time)]
        yield Row(f"reset {NUM_ENVS} x {family} {observation}", millis, "ms", at_most=bar)


def startup(repeats: int) -> Iterator[Row]:
    """Sampling levels, importing, and the first step with and without a compiled kernel in the cache."""
    dist = segar.family("objectsx3-hard")
    yield Row("sample 1000 levels", timed(lambda: dist.sample(1000, seed=1), repeats, time.process_time), "s")
    yield Row("import segar", timed(lambda: run("import segar"), repeats), "s", at_most=1.5)
    for family in ("empty-hard", "objectsx3-hard"):
        first, compiled, again = first_steps(family)
        yield Row(f"first step of {family}", [first], "s", at_most=2, note="as Python")
        yield Row("  by machine code", [compiled], "s", at_most=15, note="compiles")
        yield Row("  from the cache", [again], "s", at_most=1)


def make_env(
    family: str, observation: str = "state", num_threads: int = 1, num_envs: int = NUM_ENVS
) -> segar.envs.VectorEnv:
    """Environments on 200 levels, at their start."""
    levels = segar.family(family).sample(200, seed=0)
    env = segar.envs.VectorEnv(levels, num_envs, observation=observation, seed=0, num_threads=num_threads)
    env.reset()
    return env


def play(env: segar.envs.VectorEnv, actions: np.ndarray) -> None:
    """Take these steps and drop what they return, as agents do: who holds on to it makes the next step ask for memory."""
    for action in actions:
        env.step(action)


def random_actions(steps: int, num_envs: int = NUM_ENVS) -> np.ndarray:
    """Uniform actions, float32 ``(steps, num_envs, 2)``."""
    return np.random.default_rng(0).uniform(-1, 1, (steps, num_envs, 2)).astype(np.float32)


def first_steps(family: str) -> list[float]:
    """Seconds to build and step an environment in a fresh process: with an empty cache as users do, and as who waits for
    machine code; and with a full cache."""
    code = (
        "import time, numpy as np, segar\n"
        f"levels = segar.family('{family}').sample(10, seed=0)\n"
        "start = time.perf_counter()\n"
        "env = segar.envs.VectorEnv(levels, 4, seed=0)\n"
        "env.reset(); env.step(np.zeros((4, 2), np.float32))\n"
        "print(time.perf_counter() - start)"
    )
    with tempfile.TemporaryDirectory() as one, tempfile.TemporaryDirectory() as other:
        asked = [(one, "1"), (other, "0"), (other, "0")]
        return [float(run(code, SEGAR_CACHE_DIR=folder, SEGAR_PATIENCE=seconds)) for folder, seconds in asked]


def run(code: str, **environment: str) -> str:
    """Run Python code in a fresh process and return what it prints."""
    env = {**os.environ, **environment}
    done = subprocess.run([sys.executable, "-c", code], env=env, check=True, capture_output=True, encoding="utf-8")
    return done.stdout
