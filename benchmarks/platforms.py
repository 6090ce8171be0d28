"""Random play on SEGAR and on other platforms, one core, in turns: ``python -m benchmarks.platforms output=FILE.csv``.

The other platforms are no requirement of SEGAR:
``pip install ale-py "gymnasium[box2d,mujoco]" minigrid highway-env envpool metaworld``.
Each plays 64 environments in the way of its own that is fastest on one core (those without a batch one after another), with
random actions that were made beforehand, and with the observations that it gives by default. SEGAR draws textures.
The table has one row per platform and turn: environment steps per second of processor time, and those of SEGAR right after.
"""

from __future__ import annotations

import os
import time
from collections.abc import Callable
from importlib import import_module
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
import pandas as pd

from benchmarks.environments import make_env
from segar.analysis.tables import write_csv
from segar.experiments.commands.command_line import run_from_command_line

NUM_ENVS = 64
SECONDS = 2.0  # of processor time, of each turn
WORLD = "objectsx3-hard"  # the slowest of the paper's families

Play = Callable[[], int]
"""Plays a little and returns the number of environment steps."""


def segar_play() -> Play:
    """SEGAR, from pixels."""
    env = make_env(WORLD, "textures", num_envs=NUM_ENVS)
    return batched(env, lambda: env.action_space.sample())


def gymnasium_play(name: str, module: str = "", **options: Any) -> Play:
    """One environment of Gymnasium after another, which begin again where they end."""
    if module:
        gymnasium.register_envs(import_module(module))
    env = gymnasium.make(name, **options)
    env.reset(seed=0)
    actions = [env.action_space.sample() for _ in range(NUM_ENVS)]

    def play() -> int:
        for action in actions:
            _, _, terminated, truncated, _ = env.step(action)
            if terminated or truncated:
                env.reset()
        return len(actions)

    return play


def envpool_play(name: str) -> Play:
    """A batch of envpool in one thread."""
    env = import_module("envpool").make_gymnasium(name, num_envs=NUM_ENVS, num_threads=1, seed=0)
    return batched(env, lambda: np.array([env.action_space.sample() for _ in range(NUM_ENVS)]))


def batched(env: Any, draw: Callable[[], Any]) -> Play:
    """A vector environment that begins its episodes again by itself."""
    env.reset()
    actions = [draw() for _ in range(16)]

    def play() -> int:
        for action in actions:
            env.step(action)
        return NUM_ENVS * len(actions)

    return play


PLATFORMS: dict[str, Callable[[], Play]] = {
    "Procgen coinrun": lambda: envpool_play("CoinrunEasy-v0"),
    "Atari Pong": lambda: gymnasium_play("ALE/Pong-v5", "ale_py"),
    "Box2D CarRacing": lambda: gymnasium_play("CarRacing-v3"),
    "MuJoCo Reacher": lambda: gymnasium_play("Reacher-v5"),
    "Meta-World reach": lambda: gymnasium_play("Meta-World/MT1", "metaworld", env_name="reach-v3"),
    "MiniGrid FourRooms": lambda: gymnasium_play("MiniGrid-FourRooms-v0", "minigrid"),
    "highway-env": lambda: gymnasium_play("highway-v0", "highway_env"),
}


def rate(play: Play) -> float:
    """Environment steps per second of processor time."""
    start, steps = time.process_time(), 0
    while (spent := time.process_time() - start) < SECONDS:
        steps += play()
    return steps / spent


def main(output: Path = Path("platforms.csv"), turns: int = 5) -> None:
    """Writes the table, platforms in turns; the first turn does not count."""
    os.environ.setdefault("SDL_VIDEODRIVER", "dummy")
    own, others = segar_play(), {name: make() for name, make in PLATFORMS.items()}
    rows = []
    for turn in range(turns + 1):
        for name, play in others.items():
            speed, of_segar = rate(play), rate(own)
            print(f"{name}: {speed:,.0f} steps/s, SEGAR {of_segar:,.0f}", flush=True)
            rows += [{"platform": name, "turn": turn, "speed": speed, "segar": of_segar}] * bool(turn)
    write_csv(output, pd.DataFrame(rows), 6)


if __name__ == "__main__":
    run_from_command_line(main)
