"""Print how fast environments step, levels are sampled and kernels load, on one core of this machine."""

from __future__ import annotations

import argparse
import platform
import statistics
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np

import segar

NUM_ENVS = 1024
STEPS = 100
REPEATS = 7
ENVIRONMENTS = (
    ("empty-hard", "state", 2.4e6),
    ("objectsx3-hard", "state", 0.4e6),
    ("tilesx3-hard", "state", None),
    ("empty-hard", "rgb", None),
    ("objectsx3-hard", "rgb", 0.2e6),
    ("tilesx3-hard", "rgb", None),
)
REFERENCE_2022 = {"empty-hard": 165, "objectsx3-hard": 53, "tilesx3-hard": 85}  # env steps per core-second, pixels


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--repeats", type=int, default=REPEATS)
    repeats = parser.parse_args().repeats
    print(f"segar {segar.__version__}, {processor()}, Python {platform.python_version()}, numpy {np.__version__}")
    print(f"one thread, {NUM_ENVS} environments, 5 sub-steps, random actions; median (min to max) of {repeats} runs\n")
    print(f"{'environment':<28}{'per core-second':>18}{'range':>24}{'bar':>10}{'x 2022':>10}")
    for family, observation, bar in ENVIRONMENTS:
        rates = env_rates(family, observation, repeats)
        bar_text = f"{bar / 1e6:.1f}M" if bar else ""
        faster = f"{statistics.median(rates) / REFERENCE_2022[family]:,.0f}"
        print(f"{family + ' ' + observation:<28}{spread(rates, 1e6, 'M')}{bar_text:>10}{faster:>10}")
    print()
    print(f"{'what':<28}{'seconds':>18}{'range':>24}{'bar':>10}")
    dist = segar.family("objectsx3-hard")
    print(f"{'sample 1000 levels':<28}{spread(timed(lambda: dist.sample(1000, seed=1), repeats), 1, 's')}")
    print(f"{'import segar':<28}{spread(timed(lambda: run('import segar'), repeats), 1, 's')}{'1.5s':>10}")
    for family in ("empty-hard", "objectsx3-hard"):
        first, again = compile_times(family)
        print(f"{'first step of ' + family:<28}{first:>17.2f}s{'':>24}{'15s':>10}   (compiles)")
        print(f"{'  from the cache':<28}{again:>17.2f}s{'':>24}{'1s':>10}")


def env_rates(family: str, observation: str, repeats: int) -> list[float]:
    """Environment steps per CPU-second of this process, once per repeat."""
    levels = segar.family(family).sample(200, seed=0)
    env = segar.envs.VectorEnv(levels, NUM_ENVS, observation=observation, seed=0)
    env.reset()
    rng = np.random.default_rng(0)
    actions = rng.uniform(-1, 1, (16, NUM_ENVS, 2)).astype(np.float32)
    steps = STEPS if observation == "state" else STEPS // 4
    for action in actions[:4]:
        env.step(action)

    def roll() -> None:
        for step in range(steps):
            env.step(actions[step % len(actions)])

    return [NUM_ENVS * steps / seconds for seconds in timed(roll, repeats, time.process_time)]


def compile_times(family: str) -> tuple[float, float]:
    """Seconds to build and step an environment in a fresh process, with an empty cache and then with a full one."""
    import tempfile

    code = (
        "import time, numpy as np, segar\n"
        f"levels = segar.family('{family}').sample(10, seed=0)\n"
        "start = time.perf_counter()\n"
        "env = segar.envs.VectorEnv(levels, 4, seed=0)\n"
        "env.reset(); env.step(np.zeros((4, 2), np.float32))\n"
        "print(time.perf_counter() - start)"
    )
    with tempfile.TemporaryDirectory() as folder:
        first, again = (float(run(code, SEGAR_CACHE_DIR=folder)) for _ in range(2))
    return first, again


def run(code: str, **environment: str) -> str:
    """Run Python code in a fresh process and return what it prints."""
    import os

    env = {**os.environ, **environment}
    done = subprocess.run([sys.executable, "-c", code], env=env, check=True, capture_output=True, text=True)
    return done.stdout


def timed(function: Callable[[], object], repeats: int, clock: Callable[[], float] = time.perf_counter) -> list[float]:
    """Seconds of each of ``repeats`` calls."""
    seconds = []
    for _ in range(repeats):
        start = clock()
        function()
        seconds.append(clock() - start)
    return seconds


def spread(values: list[float], unit: float, suffix: str) -> str:
    """Median and range as two columns of the table."""
    low, high = min(values) / unit, max(values) / unit
    return f"{statistics.median(values) / unit:>17.3f}{suffix}{f'{low:.3f} to {high:.3f}':>24}"


def processor() -> str:
    """Name of the processor and number of cores."""
    info = Path("/proc/cpuinfo")
    names = (
        [x.split(":")[1].strip() for x in info.read_text().splitlines() if x.startswith("model name")]
        if info.exists()
        else []
    )
    import os

    return f"{names[0] if names else platform.processor() or platform.machine()}, {os.cpu_count()} cores"


if __name__ == "__main__":
    main()
