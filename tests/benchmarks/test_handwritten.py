"""The hand-written kernels do what the generated ones do, so that comparing their speed is fair."""

import numpy as np
import pytest

from benchmarks.handwritten import Table
from segar import Levels, World, family
from segar.engine.simulator import Simulator, State, StepResult
from tests.segar.engine.worlds import random_states, start

SAME = 1e-9
TRUTHS = ("terminated", "success", "death")


def apart(table: Table, ours: State, levels: Levels) -> float:
    """The largest difference of anything that a body holds; nan is none."""
    return float(np.abs(table.body - Table.of(ours, levels).body).max())


def play(levels: Levels, state: State, steps: int, rng: np.random.Generator) -> dict[str, int]:
    """Random play by both kernels, which must agree in every step; how often what happened.

    Episodes that end are not begun anew.
    """
    simulator, outcome = Simulator(World(), levels.layout), StepResult.empty(len(state.level))
    table, seen = Table.of(state, levels), dict.fromkeys(TRUTHS, 0)
    for _ in range(steps):
        actions = rng.uniform(-1.5, 1.5, (len(state.level), 2)).astype(np.float32)
        simulator.act(state, levels, actions, outcome)
        table.step(actions)
        assert apart(table, state, levels) <= SAME
        np.testing.assert_allclose(table.outcome.reward, outcome.reward, atol=SAME)
        for name in TRUTHS:
            assert np.array_equal(getattr(table.outcome, name), getattr(outcome, name)), name
            seen[name] += int(getattr(outcome, name).sum())
        assert np.array_equal(table.contacts, state.contacts)
        assert np.array_equal(table.unresolved_contacts, state.unresolved_contacts)
    return seen | {"contacts": int(state.contacts.sum()), "unresolved_contacts": int(state.unresolved_contacts.sum())}


NAMES = ["empty-hard", pytest.param("objectsx3-hard", marks=pytest.mark.slow)]  # which takes ten seconds to compile


@pytest.mark.parametrize("name", NAMES)
def test_both_kernels_play_the_same_episodes(name):
    levels = family(name).sample(60, seed=5)
    seen = play(levels, start(levels, 2), 120, np.random.default_rng(0))
    assert seen["contacts"] > 1000 and seen["success"] > 0


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("crowding", [1.0, 0.2])
def test_both_kernels_go_on_alike_from_hostile_states(name, crowding):
    """Overlapping, pinned, immobile, dead, very fast and magnetic bodies, some of them beyond the walls."""
    levels = family(name).sample(60, seed=5)
    state = random_states(levels, 300, np.random.default_rng(1))
    state.values[:, :, :2] *= crowding
    seen = play(levels, state, 6, np.random.default_rng(2))
    assert 0 < seen["death"] < 6 * 300
    assert seen["unresolved_contacts"] > 0 or name == "empty-hard" or crowding == 1.0
