"""How fast a kernel of a rule space runs rule sets, compared with kernels that have one of them alone."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from dataclasses import replace

import numpy as np

import segar
from benchmarks.measure import Row, in_turns
from segar.engine import Simulator, State
from segar.levels import Levels, active_options, rule_space_of
from segar.rules import World
from segar.rules.templates import dynamics_space

FAMILY = "objectsx2-hard"  # ball, goal, two objects
ENVS, SUB_STEPS, RULE_SETS = 1000, 100, 8


def rule_sets(repeats: int) -> Iterator[Row]:
    """Time of the kernel of one rule set by that of the space, on the same states; and the first compile of the space."""
    levels = segar.family(FAMILY).with_rules(dynamics_space()).sample(ENVS, seed=1)
    start = time.perf_counter()
    together = Simulator(levels.world or World(), levels.layout)
    together.step(_start(levels, 0), levels, 1)
    yield Row("first step of the rule space, with its compile", [time.perf_counter() - start], "s", at_most=60.0,
              note="near 0 where the kernel is kept from before")  # fmt: skip
    for index in range(RULE_SETS):
        alone, names = _specialised(levels, index)
        apart = Simulator(alone.world or World(), alone.layout)
        one, other = in_turns([_run(apart, alone, index), _run(together, levels, index)], repeats, time.perf_counter)
        ratios = [a / b for a, b in zip(one, other, strict=True)]
        yield Row(f"speed by that of one rule set alone: {', '.join(names)}"[:110], ratios, "x", at_least=0.25)


def _specialised(levels: Levels, index: int) -> tuple[Levels, list[str]]:
    """The levels in a world that has the rules of one of them alone, and the options that are active there."""
    space = rule_space_of(levels)
    names = [name for name, is_active in zip(space.names, active_options(levels)[index], strict=True) if is_active]
    chosen = [space.options[k] for k in sorted(map(space.index, names))]
    rules = (*space.always, *(rule for option in chosen for rule in option.rules))
    return replace(levels, world=World(rules, on_contact=[rule for one in chosen for rule in one.on_contact])), names


def _start(levels: Levels, index: int) -> State:
    """All environments at the start of one level."""
    state = State.empty(ENVS, levels.layout)
    state.level[:] = index
    state.values[:] = levels.values[index]
    column = levels.layout.columns[segar.Velocity]
    moving = state.values[:, :, column : column + 2]
    drawn = np.random.default_rng(0).uniform(-1, 1, moving.shape)
    moving[:] = np.where(np.isnan(moving), np.nan, drawn)
    return state


def _run(simulator: Simulator, levels: Levels, index: int) -> Callable[[], object]:
    return lambda: simulator.step(_start(levels, index), levels, SUB_STEPS)
