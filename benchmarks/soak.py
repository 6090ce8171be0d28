"""Play at random in every world and check every law: ``python -m benchmarks.soak --steps 10_000_000``.

All steps are checked at their end; every second one is made of single sub-steps, each of which is checked. Environments
start anew, on a random level, when their episode ends. A line per world says what happened; the exit status is 1 if
anything must not have.

Random rules may divide by zero and contradict each other, and that is no fault of the engine. A contradiction must be
raised as :class:`segar.ConflictError`; it is counted, and its environment starts anew. So does one in which a number became
nan or infinite. In both cases the interpreter, which knows nothing of the generated code, plays the same step again: if it
meets the same conflict, or comes to the same nan, that is what the rules say; if not, it is a fault. In worlds of the
default rules both are faults.
"""

from __future__ import annotations

import faulthandler
import re
import sys
import time
from collections.abc import Iterator
from dataclasses import dataclass, field, replace

import numpy as np

from benchmarks.measure import load, machine
from benchmarks.soak_checks import Checks
from benchmarks.soak_worlds import Case, cases, make_case
from segar.engine.simulator import State, StepResult
from segar.errors import ConflictError, RuleError
from segar.experiments.commands.command_line import run_from_command_line
from segar.levels.level_set import Levels
from segar.reference.interpreter import Interpreter

NUM_ENVS = 512
HANG = 900  # [s] a world that takes longer ends the soak, with a traceback
MOST_FAULTS = 5  # that are described, of one world
MOST_REPLAYS = 1000  # of one world; what random rules do beyond that is only counted


@dataclass
class Tally:
    """What happened in one world, or in all of them."""

    steps: int = 0
    checks: int = 0
    episodes: int = 0
    contacts: int = 0
    unresolved_contacts: int = 0
    overlap: float = -np.inf
    outside: float = -np.inf
    fixed: int = 0
    conflicts: int = 0
    refused: int = 0
    strange: int = 0
    replayed: int = 0
    faults: list[str] = field(default_factory=list)

    def add(self, other: Tally) -> None:
        """Take over the numbers of another world."""
        for name, value in vars(other).items():
            mine = getattr(self, name)
            setattr(self, name, max(mine, value) if name in ("overlap", "outside") else mine + value)

    def row(self, name: str, seconds: float) -> str:
        cells = [
            f"{name:<24}", f"{self.steps:>11,}", f"{self.checks:>12,}", f"{self.episodes:>9,}", f"{self.contacts:>13,}",
            f"{self.unresolved_contacts:>11,}", f"{self.overlap:>9.1e}", f"{self.outside:>9.1e}", f"{self.fixed:>7,}",
            f"{self.conflicts:>9,}", f"{self.strange:>8,}", f"{self.replayed:>8,}", f"{len(self.faults):>7,}",
            f"{seconds:>8.1f}",
        ]  # fmt: skip
        return "".join(cells)


HEADER = (
    f"{'world':<24}{'steps':>11}{'checks':>12}{'episodes':>9}{'contacts':>13}{'gave up':>11}{'overlap':>9}{'outside':>9}"
    f"{'fixed':>7}{'conflict':>9}{'strange':>8}{'replay':>8}{'FAULTS':>7}{'seconds':>8}"
)
LEGEND = """
checks     states looked at: all at the end of a step, and in every second step all at the end of each sub-step
gave up    sub-steps that met more than 64 contacts and lost the rest of their time; bodies may overlap after them
overlap    deepest overlap of two solid bodies after any other sub-step, in metres (negative: never nearer than that)
outside    farthest that a body reached beyond a wall, in metres
fixed      overlaps of two bodies that cannot move, which stay
conflict   times that random rules contradicted each other, which was raised as it should be
strange    times that random rules made a number nan or infinite
replay     times that the interpreter was asked about one of these two; what it does not confirm is a fault
"""


def main(steps: int = 10_000_000, seed: int = 0, only: str = "") -> None:
    """Play ``steps`` environment steps over all worlds whose name contains ``only``; exit with 1 if a fault is found."""
    sys.exit(soak(steps, seed, only))


def soak(steps: int, seed: int = 0, only: str = "") -> int:
    """Play that many environment steps, spread evenly over the worlds; print the table and return the exit status."""
    worlds = [(name, number) for name, number in cases(seed) if only in name]
    print(f"{machine()}\n{len(worlds)} worlds, {steps:,} environment steps, seed {seed}\n\n{HEADER}", flush=True)
    total, start = Tally(), time.perf_counter()
    for k, (name, number) in enumerate(worlds):
        faulthandler.dump_traceback_later(HANG, exit=True, file=sys.__stderr__)
        begun = time.perf_counter()
        share = max(1, (steps - total.steps) // (len(worlds) - k))
        tally = play(make_case(name, number), share, np.random.default_rng(number))
        print(tally.row(name, time.perf_counter() - begun), flush=True)
        for fault in tally.faults[:MOST_FAULTS]:
            print(f"    FAULT {fault}", flush=True)
        total.add(tally)
    faulthandler.cancel_dump_traceback_later()
    print(
        f"{total.row('all', time.perf_counter() - start)}\n{LEGEND}\nrule sets refused when built: {total.refused};",
        end="",
    )
    print(f" load {load()}\n{'no faults' if not total.faults else f'{len(total.faults)} FAULTS'}")
    return 1 if total.faults else 0


def play(case: Case, steps: int, rng: np.random.Generator, num_envs: int = NUM_ENVS) -> Tally:
    """Random play of that many environment steps in one world, or a few more."""
    run = _Run(case, rng, min(num_envs, steps))
    for step in range(-(-steps // run.num_envs)):
        run.step(by_sub_steps=step % 2 == 1)
    run.tally.contacts, run.tally.unresolved_contacts = (
        int(run.state.contacts.sum()),
        int(run.state.unresolved_contacts.sum()),
    )
    return run.tally


@dataclass(frozen=True)
class _Replay:
    """What a batch did, so that the interpreter can do it again for one environment."""

    before: State
    sub_steps: int
    actions: np.ndarray | None

    def values(self, interpreter: Interpreter, levels: Levels, env: int) -> np.ndarray | None:
        """What the interpreter comes to; None where it meets a conflict."""
        task = replace(interpreter.task, sub_steps=self.sub_steps)
        action = None if self.actions is None else self.actions[env]
        n = self.sub_steps if action is None else None
        b = self.before
        try:
            play = replace(interpreter, task=task).step
            return play(levels, int(b.level[env]), b.values[env], action, n, int(b.key[env]), int(b.tick[env])).values
        except ConflictError:
            return None


class _Run:
    """Random play in one world."""

    def __init__(self, case: Case, rng: np.random.Generator, num_envs: int) -> None:
        self.case, self.rng, self.num_envs = case, rng, num_envs
        self.simulator, self.levels, self.task = case.simulator, case.levels, case.simulator.task
        self.checks = Checks(case.levels, case.simulator.world.walls)
        self.interpreter = Interpreter(self.simulator.world, self.levels.layout, self.task)
        self.state, self.outcome = State.empty(num_envs, self.levels.layout), StepResult.empty(num_envs)
        self.age = np.zeros(num_envs, np.int64)
        self.tally = Tally(refused=case.refused)
        self._begin(np.arange(num_envs))

    def step(self, by_sub_steps: bool) -> None:
        """One step of all environments, checked at its end or after each sub-step."""
        low, high = self.task.action_low, self.task.action_high
        actions = self.rng.uniform(low, high, (self.num_envs, len(low))).astype(np.float32)
        actions[self.rng.random(self.num_envs) < 0.1] = high  # the hardest push into a corner
        failed = self._advance(1 if by_sub_steps else self.task.sub_steps, actions)
        failed |= self._check_outcome(failed)
        over = self.outcome.terminated.copy()
        for _ in range(self.task.sub_steps - 1 if by_sub_steps else 0):
            failed |= self._advance(1, None)
        self.tally.steps += self.num_envs
        self.age += 1
        self._begin(np.flatnonzero(over | failed | (self.age >= self.task.max_steps)))

    def _advance(self, sub_steps: int, actions: np.ndarray | None) -> np.ndarray:
        """Some sub-steps, with what the task does if there are actions; mark where nothing more can be asked."""
        before, failed = self.state.copy(), np.zeros(self.num_envs, np.bool_)
        try:
            if actions is None:
                self.simulator.step(self.state, self.levels, sub_steps)
            else:
                self.simulator.task = replace(self.task, sub_steps=sub_steps)
                self.simulator.act(self.state, self.levels, actions, self.outcome)
        except RuleError:
            pass  # numbers that are not finite, in some of the environments that have been stepped; the checks look for them
        except ConflictError as error:  # it names one environment, and all have been stepped nevertheless
            env = int(re.match(r"environment (\d+):", str(error))[1])  # type: ignore[index]
            failed[env] = True
            self._judge_conflict(env, str(error), _Replay(before, sub_steps, actions))
        return failed | self._check(_Replay(before, sub_steps, actions))

    def _check(self, replay: _Replay) -> np.ndarray:
        """Hold all states to the laws; mark those that do not keep them."""
        tally, strange = self.tally, self.checks.strange(self.state)
        tally.checks += self.num_envs
        for env in np.flatnonzero(strange):
            self._judge_strange(int(env), replay)
        overlap, outside, fixed = self.checks.depths(self.state)
        resolved = ~strange & (self.state.unresolved_contacts == replay.before.unresolved_contacts)
        tally.overlap = max(tally.overlap, float(overlap[resolved].max(initial=-np.inf)))
        tally.outside = max(tally.outside, float(outside[~strange].max(initial=-np.inf)))
        tally.fixed += int(fixed[~strange].sum())
        failed = strange.copy()
        for env, what in self.checks.faults(self.state, replay.before, replay.sub_steps):
            if not strange[env]:
                self._fault(env, what)
                failed[env] = True
        return failed

    def _check_outcome(self, failed: np.ndarray) -> np.ndarray:
        """A reward that is no number although the state is fine."""
        wrong = ~np.isfinite(self.outcome.reward) & ~failed
        for env in np.flatnonzero(wrong):
            self._fault(int(env), f"the reward is {self.outcome.reward[env]}")
        return wrong

    def _judge_conflict(self, env: int, said: str, replay: _Replay) -> None:
        """Rules contradict each other: of random ones the interpreter must say so too, default ones must not."""
        if not self.case.rules_may_fail:
            self._fault(env, said)
            return
        self.tally.conflicts += 1
        if self._may_replay() and replay.values(self.interpreter, self.levels, env) is not None:
            self._fault(env, f"{said}; but the interpreter sees no conflict")

    def _judge_strange(self, env: int, replay: _Replay) -> None:
        """A number is nan or infinite: the interpreter must come to the same; with the default rules it must not be."""
        places = ", ".join(self._places(env))
        if not self.case.rules_may_fail:
            self._fault(env, f"nan or infinite: {places}")
            return
        self.tally.strange += 1
        if self._may_replay():
            values = replay.values(self.interpreter, self.levels, env)
            # Rules that contradict each other about nan have been judged already.
            if values is not None and (np.isfinite(values) != np.isfinite(self.state.values[env])).any():
                self._fault(env, f"nan or infinite, but not by the interpreter: {places}")

    def _may_replay(self) -> bool:
        """Count a replay, as long as there were not too many."""
        if self.tally.replayed == MOST_REPLAYS:
            return False
        self.tally.replayed += 1
        return True

    def _places(self, env: int) -> Iterator[str]:
        """Entities and factors whose numbers are strange."""
        layout = self.levels.layout
        wrong = np.isfinite(self.state.values[env]) == self.checks.lacks[self.state.level[env]]
        for factor, column in layout.columns.items():
            for slot in np.flatnonzero(wrong[:, column : column + factor.width].any(axis=1)):
                yield f"{factor.__name__} of {layout.names[slot]}"

    def _fault(self, env: int, what: str) -> None:
        at = f"environment {env}, level {self.state.level[env]}, sub-step {self.state.tick[env]} of its episode"
        self.tally.faults.append(f"{self.case.name}, {at}: {what}")

    def _begin(self, rows: np.ndarray) -> None:
        """Start episodes on random levels."""
        self.tally.episodes += len(rows)
        self.state.level[rows] = self.rng.integers(len(self.levels), size=len(rows))
        self.state.values[rows] = self.levels.values[self.state.level[rows]]
        self.state.key[rows] = self.rng.integers(2**63, size=len(rows))
        self.state.tick[rows] = self.age[rows] = 0


if __name__ == "__main__":
    run_from_command_line(main)
