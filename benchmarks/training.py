"""Print how fast agents learn from pixels on this machine, each number beside its bar: python -m benchmarks.training.

Whole training is timed: 64 environments with 64 x 64 frames, policy, losses, gradient steps, figures to log. Each run is
a process of its own, as a training run is. Medians are over iterations, which share what else the machine does.
"""

from __future__ import annotations

import json
import statistics
import subprocess
import sys
import time
from collections.abc import Iterator, Sequence

from benchmarks.measure import Row, print_parts
from segar.experiments.commands.command_line import run_from_command_line
from segar.experiments.settings import require_known

ITERATIONS = 12
WARM = 2  # iterations that do not count
# What is timed for the bars: 30 steps, four minibatches, one epoch; one CNN for all heads, which are linear.
PLAIN = ("algorithm=ppo", "algorithm.head_width=0", "algorithm.entropy_coef=0", "algorithm.critic_coef=1")
BARS = {"small": 9000.0, "nature": 6500.0, "impala": 1300.0}  # frames/s with two threads
ENVIRONMENT_BAR = 5.0  # [%] of the time
SIDE_BY_SIDE_BAR = 1.5
AS_THEY_ARE = ("ppo", "ppo_fast", "ppo_procgen", "ppo_recurrent")


def frames_per_second(iterations: int) -> Iterator[Row]:
    """Frames per second with two threads, and what of the time the environments take."""
    for encoder, bar in BARS.items():
        (found,) = train_side_by_side([(*PLAIN, f"algorithm.encoder={encoder}", "num_threads=2")], iterations)
        yield Row(f"PPO, {encoder}, 2 threads", found["rates"], "f/s", at_least=bar, note=per_core(found))
        if encoder == "small":
            yield Row("environments' share of that", found["shares"], "%", at_most=ENVIRONMENT_BAR)


def side_by_side(iterations: int) -> Iterator[Row]:
    """Two runs with a thread each, together over one of them alone."""
    for encoder in ("small", "nature"):
        run = (*PLAIN, f"algorithm.encoder={encoder}", "num_threads=1")
        (alone,) = train_side_by_side([run], iterations)
        both = train_side_by_side([run, run], iterations)
        yield Row(f"PPO, {encoder}, 1 thread", alone["rates"], "f/s", note=per_core(alone))
        ratio = sum(statistics.median(one["rates"]) for one in both) / statistics.median(alone["rates"])
        yield Row("two such runs side by side / one", [ratio], "x", at_least=SIDE_BY_SIDE_BAR)


def as_they_are(iterations: int) -> Iterator[Row]:
    """The algorithms of conf/algorithm with their own settings."""
    for name in AS_THEY_ARE:
        few = max(2, iterations // 4)
        (found,) = train_side_by_side([(f"algorithm={name}", "num_threads=2")], few)
        yield Row(f"algorithm={name}, 2 threads", found["rates"], "f/s", note=per_core(found))


PARTS = {"bars": frames_per_second, "side_by_side": side_by_side, "as_they_are": as_they_are}


def per_core(found: dict) -> str:
    """Frames per second of the processor's time, which other processes disturb less."""
    return f"{statistics.median(found['per_core']):,.0f} per core-second"


def train_side_by_side(runs: Sequence[Sequence[str]], iterations: int) -> list[dict]:
    """What :func:`train` says of each run, all of them at the same time in processes of their own."""
    command = [sys.executable, "-m", "benchmarks.training", f"iterations={iterations}"]
    started = [
        subprocess.Popen([*command, f"run={json.dumps([*run])}"], stdout=subprocess.PIPE, encoding="utf-8")
        for run in runs
    ]
    said = [process.communicate()[0] for process in started]
    return [json.loads(one.splitlines()[-1]) for one in said]


def train(overrides: Sequence[str], iterations: int) -> dict[str, list[float]]:
    """Trains a little; per iteration: frames per second, the same per core-second, the environments' share in %."""
    from segar.experiments.commands import process_defaults as runtime
    from segar.experiments.commands.hydra_app import compose
    from segar.experiments.levels.builders import Prepared, make_levels
    from segar.experiments.settings import import_object

    config = compose(["levels=empty-hard", "levels.count=200", "observation=rgb", *overrides])
    runtime.set_process_defaults(config.num_threads)
    kind = import_object(config.algorithm.learner, "algorithm")
    levels, _ = make_levels(config.levels)
    num_envs = config.algorithm.num_envs
    env = kind.make_env(levels, num_envs, seed=config.seed, **Prepared(config).env_options(num_envs))
    learner = kind(config.algorithm, env, 10**6, config.seed)
    in_environments = 0.0
    step = env.step

    def timed_step(actions):
        nonlocal in_environments
        began = time.perf_counter()
        result = step(actions)
        in_environments += time.perf_counter() - began
        return result

    env.step = timed_step
    found: dict[str, list[float]] = {"rates": [], "per_core": [], "shares": []}
    for iteration in range(WARM + iterations):
        before, in_environments, wall, cpu = learner.frames, 0.0, time.perf_counter(), time.process_time()
        learner.iterate()
        wall, cpu = time.perf_counter() - wall, time.process_time() - cpu
        if iteration >= WARM:
            frames = learner.frames - before
            for name, value in (
                ("rates", frames / wall),
                ("per_core", frames / cpu),
                ("shares", 100 * in_environments / wall),
            ):
                found[name].append(value)
    return found


def main(iterations: int = ITERATIONS, only: tuple[str, ...] = tuple(PARTS), run: tuple[str, ...] = ()) -> None:
    """Measure some parts, each run for so many iterations; or make one run with settings ``run``, and print its times."""
    for part in only:
        require_known("only", part, list(PARTS))
    if run:
        print(json.dumps(train(run, iterations)))
    else:
        print_parts("f/s: frames per second", [PARTS[part] for part in only], iterations)


if __name__ == "__main__":
    run_from_command_line(main)
