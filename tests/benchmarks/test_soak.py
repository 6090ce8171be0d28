"""The soak finds what it looks for: planted faults are told from what random rules may do."""

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from benchmarks.soak import Tally, play, soak
from benchmarks.soak_worlds import Case
from segar import DEFAULT_RULES, ConflictError, Levels, World, move
from segar.engine.simulator import State
from segar.language import Ball, Charge, GoalTile, GolfBall, Mass, Mobile, Position, SetFactor, Velocity
from tests.segar.engine.worlds import read, uncompiled

LEVELS = Levels.from_entities([
    [GolfBall({Position: (x, -0.5)}), GoalTile({Position: (0.8, 0.8)}), Ball({Position: (x, 0.3)})] for x in (0.0, 0.5)
])  # fmt: skip
ENVS, STEPS = 4, 3


class Spoiled:
    """A simulator that spoils what it made, in the last environment, the first time that it makes something."""

    def __init__(self, simulator: Any, spoil: Callable[[State, Any], None]) -> None:
        self.simulator, self.spoil, self.pure = simulator, spoil, True
        self.world, self.task = simulator.world, simulator.task

    def act(self, state: State, levels: Levels, actions: np.ndarray, outcome: Any) -> None:
        self.simulator.task = self.task
        self.simulator.act(state, levels, actions, outcome)
        if self.pure:
            self.pure = False
            self.spoil(state, outcome)

    def step(self, state: State, levels: Levels, n: int) -> None:
        self.simulator.step(state, levels, n)


def played(spoil: Callable[[State, Any], None], world: World | None = None, rules_may_fail: bool = False) -> Tally:
    simulator: Any = Spoiled(uncompiled(world or World(), LEVELS.layout), spoil)
    case = Case("spoiled", simulator, LEVELS, rules_may_fail)
    return play(case, ENVS * STEPS, np.random.default_rng(0), ENVS)


def leave(state: State, outcome: Any) -> None:
    """Spoil nothing."""


def lose_a_mass(state: State, outcome: Any) -> None:
    read(state, LEVELS, Mass)[-1, 2] = np.nan


def give_the_goal_a_mass(state: State, outcome: Any) -> None:
    read(state, LEVELS, Mass)[-1, 1] = 1.0


def speed_without_end(state: State, outcome: Any) -> None:
    read(state, LEVELS, Velocity)[-1, 0] = np.inf


def overlap(state: State, outcome: Any) -> None:
    x = read(state, LEVELS, Position)
    x[-1, 2] = x[-1, 0] + (0.1, 0.0)


def leave_the_arena(state: State, outcome: Any) -> None:
    read(state, LEVELS, Position)[-1, 2] = (0.5, -0.95)


def never_stop_colliding(state: State, outcome: Any) -> None:
    state.contacts[-1] += 1000


def forget_the_reward(state: State, outcome: Any) -> None:
    outcome.reward[-1] = np.nan


def quarrel(state: State, outcome: Any) -> None:
    raise ConflictError(f"environment {ENVS - 1}: two rules disagree")


FAULTS = [
    (lose_a_mass, "nan or infinite: Mass of ball"),
    (give_the_goal_a_mass, "nan or infinite: Mass of goal"),
    (speed_without_end, "nan or infinite: Velocity of golfball"),
    (overlap, "two bodies overlap by 1.0e-01 m"),
    (leave_the_arena, "a body reaches 5.0e-02 m beyond a wall"),
    (never_stop_colliding, "1000 contacts and 0 times given up in 5 sub-steps"),
    (forget_the_reward, "the reward is nan"),
    (quarrel, "two rules disagree"),
]


def test_sound_play_has_no_faults_and_is_counted():
    tally = played(leave)
    assert tally.faults == []
    assert tally.steps == ENVS * STEPS
    assert tally.checks == ENVS * (1 + 5 + 1)  # whole steps at their end, the second one in all five sub-steps
    assert tally.episodes == ENVS and tally.overlap < 0 and tally.outside < 0


@pytest.mark.parametrize(("spoil", "message"), FAULTS, ids=lambda value: getattr(value, "__name__", ""))
def test_a_planted_fault_is_found_and_its_environment_starts_anew(spoil, message):
    tally = played(spoil)
    (fault,) = tally.faults
    assert fault.startswith(f"spoiled, environment {ENVS - 1}, level ") and message in fault
    assert tally.episodes == ENVS + 1


def test_overlap_is_no_fault_where_a_sub_step_gave_up_or_nothing_can_move():
    def give_up(state: State, outcome: Any) -> None:
        overlap(state, outcome)
        state.unresolved_contacts[-1] += 1

    def fix(state: State, outcome: Any) -> None:
        overlap(state, outcome)
        read(state, LEVELS, Mobile)[-1, [0, 2]] = 0.0
        read(state, LEVELS, Velocity)[-1, [0, 2]] = 0.0

    assert played(give_up).faults == []
    tally = played(fix)
    assert tally.faults == [] and tally.fixed >= 1 and tally.overlap < 0


def divide(q: Charge, v: Velocity) -> SetFactor[Charge]:
    """0 / 0 for what is at rest."""
    return SetFactor[Charge](q, v.y / v.y)


def set_one(q: Charge, x: Position) -> SetFactor[Charge]:
    return SetFactor[Charge](q, 1.0) if x.x > 0.25 else None


def set_two(q: Charge, x: Position) -> SetFactor[Charge]:
    return SetFactor[Charge](q, 2.0) if x.x > 0.25 else None


def test_nan_that_the_rules_ask_for_is_no_fault():
    tally = played(leave, World((move, divide)), rules_may_fail=True)
    assert tally.faults == [] and tally.strange >= ENVS and tally.replayed == tally.strange
    (fault, *_) = played(leave, World((move, divide))).faults
    assert "nan or infinite: Charge of ball" in fault


def test_nan_that_the_interpreter_does_not_see_is_a_fault_whatever_the_rules():
    (fault,) = played(lose_a_mass, World(DEFAULT_RULES), rules_may_fail=True).faults
    assert "nan or infinite, but not by the interpreter: Mass of ball" in fault


def test_a_conflict_is_counted_if_the_interpreter_sees_it_too():
    tally = played(leave, World((move, set_one, set_two)), rules_may_fail=True)
    assert tally.faults == [] and tally.conflicts >= 1
    (fault,) = played(quarrel, rules_may_fail=True).faults
    assert "but the interpreter sees no conflict" in fault


@pytest.mark.slow
def test_a_short_soak_of_all_worlds_finds_no_fault(capsys):
    assert soak(20_000) == 0
    assert "no faults" in capsys.readouterr().out
