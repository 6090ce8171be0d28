"""The generated kernels beside what else one could use: a kernel written by hand, and pymunk."""

from __future__ import annotations

import math
import time
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
import pymunk

from benchmarks.environments import NUM_ENVS, make_env, random_actions
from benchmarks.handwritten import Table
from benchmarks.measure import Row, in_turns, timed
from segar.engine.simulator import Simulator, State, StepResult
from segar.levels.level_set import Levels

STEPS = 20
WARM_UP = 50  # steps until speeds and places are those of play, not of the start
# [million per core-second] What 0.7 of the hand-written kernel was expected to be.
RATES = {"empty-hard": 5.0, "objectsx3-hard": 0.55}


def handwritten(repeats: int) -> Iterator[Row]:
    """Simulator against simulator: no observations, resets or info, the same states and actions for both."""
    for family, bar in RATES.items():
        env, actions = make_env(family), random_actions(STEPS)
        for step in range(WARM_UP):
            env.step(actions[step % STEPS])
        duel = _Duel(env.simulator, env.levels, env.state().state, actions)
        rolls = [duel.roll_generated, duel.roll_handwritten]
        mine, others = in_turns(rolls, 3 * repeats, time.process_time, [duel.begin, duel.begin])
        million = NUM_ENVS * STEPS / 1e6
        yield Row(f"simulator {family}, generated", [million / s for s in mine], "M/s", at_least=bar)
        yield Row(f"simulator {family}, hand-written", [million / s for s in others], "M/s")
        ratios = [b / a for a, b in zip(mine, others, strict=True)]
        yield Row(f"  generated / hand-written, {family}", ratios, at_least=0.7)


@dataclass
class _Duel:
    """The same states and actions for both simulators, which a test holds to the same trajectories."""

    simulator: Simulator
    levels: Levels
    start: State
    actions: np.ndarray

    def begin(self) -> None:
        self.generated, self.handwritten = self.start.copy(), Table.of(self.start, self.levels)
        self.outcome = StepResult.empty(NUM_ENVS)

    def roll_generated(self) -> None:
        for action in self.actions:
            self.simulator.act(self.generated, self.levels, action, self.outcome)

    def roll_handwritten(self) -> None:
        for action in self.actions:
            self.handwritten.step(action)


def against_pymunk(repeats: int) -> Iterator[Row]:
    """A scene of pymunk of the size of ``objectsx3-hard``: for scale, since it has no floor, no fields and no task."""
    space, ball = pymunk_scene(np.random.default_rng(0))
    impulses = (2.0 * random_actions(4).reshape(-1, 2)).tolist()

    def roll() -> None:
        for impulse in impulses:
            ball.apply_impulse_at_local_point(impulse)
            for _ in range(5):
                space.step(0.01)

    rates = [len(impulses) / s / 1e6 for s in timed(roll, repeats, time.process_time)]
    yield Row("pymunk, four discs and four walls", rates, "M/s", note="for scale: compare simulator objectsx3-hard")


def pymunk_scene(rng: np.random.Generator) -> tuple[pymunk.Space, Any]:
    """Four discs between four thick walls, slowed by drag, and the one that is pushed."""
    space = pymunk.Space()
    space.damping = 0.1  # share of the speed that a second leaves
    for corner, other in (((-2, -2), (2, -2)), ((2, -2), (2, 2)), ((2, 2), (-2, 2)), ((-2, 2), (-2, -2))):
        wall = pymunk.Segment(space.static_body, corner, other, 1.0)
        wall.elasticity = 0.975
        space.add(wall)
    discs = []
    for corner in ((-0.5, -0.5), (0.5, -0.5), (-0.5, 0.5), (0.5, 0.5)):
        disc = pymunk.Body(1.0, math.inf)
        disc.position = tuple(np.add(corner, rng.uniform(-0.3, 0.3, 2)))
        shape = pymunk.Circle(disc, 0.1)
        shape.elasticity = 1.0
        space.add(disc, shape)
        discs.append(disc)
    return space, discs[0]
