"""How cost grows: with threads, and with the number of bodies."""

from __future__ import annotations

import math
import statistics
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import partial

import numpy as np
from numba import njit

import segar
from benchmarks.environments import NUM_ENVS, make_env, play, random_actions
from benchmarks.measure import Row, in_turns
from segar.engine.simulator import Simulator, State, StepResult
from segar.envs import VectorEnv
from segar.language.factors import Charge, Mobile, Position, Size, Velocity
from segar.levels.level_set import Levels
from segar.support.threads import Team

STEPS = 20
SUB_STEPS = 5
BODIES = (4, 8, 16, 32, 64)
CROWDS = 128  # environments with many bodies
# Diameter of each of n balls [m]: always small, or always the same share of the arena for all together.
DIAMETERS: dict[str, Callable[[int], float]] = {
    "0.06 m": lambda n: 0.06,
    "0.4 m / sqrt(N)": lambda n: 0.4 / n**0.5,
}
SPEED = 1.0  # [m/s] in x and in y, standard deviation


def threads(repeats: int) -> Iterator[Row]:
    """Wall time of one thread over that of two, in turns, beside what the machine gives to bare arithmetic just then.

    Handing work to a second thread costs what it takes to wake a core, whatever the work: a larger batch shows the rest.
    """
    for what, family, num_envs, bar in (
        ("simulator", "empty-hard", NUM_ENVS, 1.7),
        ("VectorEnv", "empty-hard", NUM_ENVS, 1.7),
        ("simulator", "objectsx3-hard", NUM_ENVS, 1.7),
        ("VectorEnv", "objectsx3-hard", NUM_ENVS, 1.7),
        ("simulator", "objectsx3-hard", 8 * NUM_ENVS, None),
    ):
        rolls = [_roll(what, make_env(family, num_threads=n, num_envs=num_envs)) for n in (1, 2)]
        bare = [partial(Team(n).do_range, burn_range, LONG) for n in (1, 2)]
        one, two, bare_one, bare_two = in_turns([*rolls, *bare], 5 * repeats, time.perf_counter)
        ratios = [a / b for a, b in zip(one, two, strict=True)]
        possible = statistics.median(a / b for a, b in zip(bare_one, bare_two, strict=True))
        note = f"shortest over shortest {min(one) / min(two):.2f}; arithmetic alone {possible:.2f}"
        yield Row(f"2 threads / 1, {what} {num_envs} x {family}", ratios, "x", at_least=bar, note=note)


def _roll(what: str, env: VectorEnv) -> Callable[[], object]:
    """Some steps of the environments, or of their simulator alone."""
    actions = random_actions(STEPS, env.num_envs)
    if what == "VectorEnv":
        return lambda: play(env, actions)
    state, outcome = env.state().state, StepResult.empty(env.num_envs)
    return lambda: [env.simulator.act(state, env.levels, action, outcome) for action in actions]


LONG = 10_000_000  # additions, some 10 ms


@njit(nogil=True)
def burn_range(start: int, stop: int) -> float:
    """What any machine should do twice as fast on two cores."""
    total = 0.0
    for i in range(start, stop):
        total += math.sqrt(i)
    return total


def bodies(repeats: int) -> Iterator[Row]:
    """Cost of a step against the number of uncharged balls, with the exponent of a fit over all N.

    A gas of balls that nothing slows is the hard case: in random play friction brings most of them to rest.
    """
    for name, diameter in DIAMETERS.items():
        yield from _growth(f"balls of {name}, gas", [_crowd(n, diameter(n), SPEED) for n in BODIES], repeats)
    yield from _growth("balls of 0.06 m, random play", [_crowd(n, 0.06, None) for n in BODIES], repeats)


def _growth(what: str, crowds: list[_Crowd], repeats: int) -> Iterator[Row]:
    seconds = in_turns([crowd.roll for crowd in crowds], 2 * repeats, time.process_time)
    micros = [[s / (CROWDS * STEPS) * 1e6 for s in mine] for mine in seconds]
    for n, crowd, cost in zip(BODIES, crowds, micros, strict=True):
        contacts = crowd.state.contacts.mean() / ((2 * repeats + 1) * STEPS)
        yield Row(f"{n} {what}", cost, "µs", note=f"{contacts:.2f} contacts per step")
    exponents = [float(np.polyfit(np.log(BODIES), np.log(costs), 1)[0]) for costs in zip(*micros, strict=True)]
    yield Row(f"  exponent of N, {what}", exponents, at_most=1.5)


@dataclass
class _Crowd:
    """A batch of environments with some number of balls, pushed at random where there are actions."""

    simulator: Simulator
    levels: Levels
    state: State
    actions: np.ndarray | None

    def roll(self) -> None:
        """Go on for some steps."""
        outcome = StepResult.empty(CROWDS)
        for step in range(STEPS):
            if self.actions is None:
                self.simulator.step(self.state, self.levels, SUB_STEPS)
            else:
                self.simulator.act(self.state, self.levels, self.actions[step], outcome)


def _crowd(count: int, diameter: float, speed: float | None) -> _Crowd:
    """That many balls, of which the golf ball is one, at random places.

    Args:
        speed: of all of them, with nothing to slow them; None: at rest, on the usual floor, one pushed at random.
    """
    dist = segar.LevelDistribution(
        numbers=[(segar.GolfBall, 1), (segar.GoalTile, 1), (segar.Ball, count - 1)],
        priors=[
            segar.Prior(Position, segar.RandomUniformLocation()),
            segar.Prior(Size, diameter, entity_type=segar.Object),
            segar.Prior(Mobile, True),
            segar.Prior(Charge, 0.0),
        ],
        parameters={} if speed is None else {segar.language.FloorFriction: 0.0, segar.language.WallDamping: 0.0},
        min_distance=0.0,
    )
    levels = dist.sample(CROWDS, seed=0)
    state = State.empty(CROWDS, levels.layout)
    state.level[:] = np.arange(CROWDS)
    state.values[:] = levels.values
    simulator = Simulator(segar.World(), levels.layout)
    if speed is None:
        return _Crowd(simulator, levels, state, random_actions(STEPS)[:, :CROWDS])
    v = levels.layout.columns[Velocity]
    part = state.values[:, :, v : v + 2]
    part[:] = np.where(np.isnan(part), np.nan, np.random.default_rng(0).normal(0, speed, part.shape))
    return _Crowd(simulator, levels, state, None)
