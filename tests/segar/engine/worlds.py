"""What the engine's tests share: random states, one comparison, and kernels that run without being compiled."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any
from unittest import mock

import numpy as np
import pytest

from segar import Acceleration, ConflictError, Interpreter, Levels, Magnetism, Position, RuleError, Velocity, World
from segar.engine.compiler.running_kernel import RunningKernel
from segar.engine.simulator import Simulator, State, StepResult
from segar.language.factors import Alive, Charge, Done, Drag, InfiniteEnergy, Mass, Mobile, StoredEnergy
from segar.support import PATIENCE


def start(levels: Levels, copies: int = 1) -> State:
    """States at the beginning of each level, ``copies`` times over."""
    state = State.empty(len(levels) * copies, levels.layout)
    state.level[:] = np.tile(np.arange(len(levels)), copies)
    state.values[:] = levels.values[state.level]
    return state


def random_states(levels: Levels, count: int, rng: Any, speed: float | None = None) -> State:
    """States of random levels in which nothing is as the levels say: overlapping, dead, immobile, slow and fast bodies.

    Args:
        speed: standard deviation of velocities [m/s]; None: each state has its own, from 1e-6 to 10.
    """
    state = State.empty(count, levels.layout)
    state.level[:] = rng.integers(len(levels), size=count)
    state.key[:] = rng.integers(2**63, size=count)
    state.tick[:] = rng.integers(100, size=count)
    state.values[:] = levels.values[state.level]
    scale = 10.0 ** rng.uniform(-6, 1, (count, 1, 1)) if speed is None else speed
    draws = {
        Position: lambda shape: rng.uniform(-0.95, 0.95, shape),
        Velocity: lambda shape: rng.normal(0, 1, shape) * scale,
        Acceleration: lambda shape: rng.normal(0, 3, shape),
        Drag: lambda shape: rng.normal(0, 1, shape),
        Mass: lambda shape: np.where(rng.random(shape) < 0.1, 0.09, rng.uniform(0.2, 3, shape)),
        StoredEnergy: lambda shape: rng.choice([0, 0, -1, 1, 0.5], shape),
        InfiniteEnergy: lambda shape: rng.random(shape) < 0.5,
        Mobile: lambda shape: rng.random(shape) < 0.8,
        Alive: lambda shape: rng.random(shape) < 0.9,
        Done: lambda shape: rng.random(shape) < 0.1,
        Charge: lambda shape: rng.choice([0, 1, -1, 0.3], shape),
        Magnetism: lambda shape: rng.choice([0, 0, 1, -1, 0.3], shape),
    }
    for factor, column in levels.layout.columns.items():
        if factor in draws:
            part = state.values[..., column : column + factor.width]
            part[:] = np.where(np.isnan(part), np.nan, draws[factor](part.shape))
    return state


def read(state: State, levels: Levels, factor: type) -> np.ndarray:
    """View of a factor, float64 ``(num_envs, entities)`` or ``(num_envs, entities, 2)``."""
    column = levels.layout.columns[factor]
    part = state.values[..., column : column + factor.width]
    return part if factor.width == 2 else part[..., 0]


CROWDED = 4  # contacts in one step beyond which they amplify rounding errors too far


@dataclass
class Disagreement:
    """The largest difference of kernel and interpreter, of states with many contacts apart, and what happened."""

    worst: float = 0.0
    worst_crowded: float = 0.0
    contacts: int = 0
    unresolved_contacts: int = 0
    conflicts: int = 0


def compare(simulator: Simulator, levels: Levels, state: State, actions: Any = None, n: int = 1) -> Disagreement:
    """Step every state by kernel and by interpreter; raises where they disagree in anything but rounding.

    Differences are relative to the number where that is above 1; nan must meet nan.
    """
    interpreter = Interpreter(simulator.world, levels.layout, simulator.task)
    found = Disagreement()
    for e in range(len(state.level)):
        ours, outcome = _pick(state, e), StepResult.empty(1)
        complaint = _step(simulator, levels, ours, None if actions is None else actions[e : e + 1], n, outcome)
        key, tick = int(state.key[e]), int(state.tick[e])
        action = None if actions is None else actions[e]
        steps = n if actions is None else None
        try:
            theirs = interpreter.step(levels, state.level[e], state.values[e], action, steps, key, tick)
        except ConflictError as error:
            assert complaint, f"state {e}: only the interpreter raises: {error}"
            found.conflicts += 1
            continue
        assert not complaint, f"state {e}: only the kernel raises: {complaint}"
        a, b = ours.values[0], theirs.values
        assert np.array_equal(np.isnan(a), np.isnan(b)), f"state {e}: nan in other places"
        with np.errstate(invalid="ignore"):
            apart = np.where(a == b, 0.0, np.abs(a - b) / np.maximum(1.0, np.abs(b)))
        difference = float(np.nanmax(apart, initial=0.0))
        if theirs.contacts > CROWDED:
            found.worst_crowded = max(found.worst_crowded, difference)
        else:
            found.worst = max(found.worst, difference)
        assert ours.tick[0] == theirs.tick and ours.contacts[0] - state.contacts[e] == theirs.contacts, f"state {e}"
        assert ours.unresolved_contacts[0] - state.unresolved_contacts[e] == theirs.unresolved_contacts
        if actions is not None:
            assert outcome.reward[0] == pytest.approx(theirs.reward, rel=1e-12, abs=1e-12, nan_ok=True)
            says = bool(outcome.terminated[0]), bool(outcome.success[0]), bool(outcome.death[0])
            assert says == (theirs.terminated, theirs.success, theirs.death), f"state {e}"
        found.contacts += theirs.contacts
        found.unresolved_contacts += theirs.unresolved_contacts
    return found


def set_factor(state: State, levels: Levels, factor: type, value: Any) -> None:
    """Set a factor of all entities that hold it; ``value`` broadcasts to ``(num_envs, entities[, 2])``."""
    part = read(state, levels, factor)
    part[:] = np.where(np.isnan(part), np.nan, value)


def after(engine: str, rules: Sequence[Any], levels: Levels, n: int = 1, key: Any = 0, **contacts: Any) -> State:
    """The levels after ``n`` sub-steps from their start, by the ``"interpreter"`` or by the generated ``"source"``.

    With an array of keys, uint64 ``(k,)``, each level runs once for each key.
    """
    world, state = World(rules, **contacts), start(levels, np.size(key))
    state.key[:] = np.repeat(key, len(levels))
    if engine == "source":
        uncompiled(world, levels.layout).step(state, levels, n)
        return state
    interpreter = Interpreter(world, levels.layout)
    for e in range(len(state.level)):
        result = interpreter.step(levels, state.level[e], n=n, key=int(state.key[e]))
        state.values[e], state.tick[e], state.contacts[e] = result.values, result.tick, result.contacts
    return state


def compiled(world: World, layout: Any, *task: Any) -> Simulator:
    """A simulator whose kernel is compiled, whatever the test that asks for it."""
    with mock.patch.dict("os.environ", {PATIENCE: "0"}):
        return Simulator(world, layout, *task)


def uncompiled(world: World, layout: Any, task: Any = None) -> Simulator:
    """A simulator whose generated source runs as plain Python: slow, but there is nothing to compile."""
    with mock.patch("segar.engine.simulator.running_kernel", lambda source: RunningKernel(source, float("inf"))):
        return Simulator(world, layout) if task is None else Simulator(world, layout, task)


def _step(simulator: Simulator, levels: Levels, state: State, actions: Any, n: int, outcome: StepResult) -> str:
    try:
        if actions is None:
            simulator.step(state, levels, n)
        else:
            simulator.act(state, levels, np.asarray(actions, np.float32), outcome)
    except RuleError:
        pass  # a number is not finite, and must be the same in the interpreter
    except ConflictError as error:
        return str(error)
    return ""


def _pick(state: State, e: int) -> State:
    return State(**{name: array[e : e + 1].copy() for name, array in vars(state).items()})
