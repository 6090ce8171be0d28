"""Print what curricula cost of the frames per second, beside the bar: python -m benchmarks.curricula.

Whole training from states with ``ppo_fast`` is timed, with logs of what was played: blocks of iterations without a curriculum
(A) and with one (B), in one process, in the order A B B A, so that what else the machine does falls on both alike. The
processor's time counts, which other processes disturb less than the wall clock.
"""

from __future__ import annotations

import time
from collections.abc import Iterator
from functools import partial

from benchmarks.measure import Row, print_parts
from segar.experiments.commands.command_line import run_from_command_line
from segar.experiments.settings import require_known

ROUNDS = 7
ITERATIONS = 25  # of a block, in which one line is logged
WARM = 40  # iterations before the first block: buffers are full, and all has been compiled
BAR = 15.0  # [%] of the frames per second
BASE = ("suite=place-few-v1", "algorithm=ppo_fast", "observation=state", "num_threads=1")
COMPARED = {
    "endless, no curriculum": ("levels.count=endless",),
    "uniform, fixed set": ("curriculum=uniform",),
    "plr, fixed set": ("curriculum=plr",),
    "plr, endless": ("curriculum=plr", "levels.count=endless"),
    "plr_robust, endless": ("curriculum=plr_robust", "levels.count=endless"),
    "accel, endless": ("curriculum=accel", "levels.count=endless"),
    "sfl, endless": ("curriculum=sfl", "levels.count=endless"),
}


class Trained:
    """A run in training, without folder and evaluation."""

    def __init__(self, overrides: tuple[str, ...]) -> None:
        from segar.experiments.algorithms.learner import learner_class, make_learner
        from segar.experiments.commands.hydra_app import compose
        from segar.experiments.commands.process_defaults import set_process_defaults
        from segar.experiments.levels.builders import Prepared
        from segar.experiments.training.preparation import make_environment, training_levels

        config = compose([*BASE, *overrides]).resolved()
        set_process_defaults(config.num_threads)
        kind, prepared = learner_class(config.algorithm), Prepared(config)
        self.chosen = training_levels(kind, prepared)
        env = make_environment(kind, prepared, prepared.level_sets[0]) if self.chosen is None else self.chosen.env
        self.learner = make_learner(kind, config.algorithm, env, 10**8, config.seed)
        if self.chosen is not None:
            self.chosen.connect(self.learner)
            self.chosen.begin(self.learner)

    def rate(self, iterations: int) -> float:
        """Frames per second of the processor's time."""
        before, began = self.learner.frames, time.process_time()
        for _ in range(iterations):
            self.learner.iterate()
            if self.chosen is not None:
                self.chosen.advance(self.learner)
        return (self.learner.frames - before) / (time.process_time() - began)


def cost(name: str, rounds: int) -> Iterator[Row]:
    """How much slower training with one of :data:`COMPARED` is."""
    plain, chosen = Trained(()), Trained(COMPARED[name])
    for one in (plain, chosen):
        one.rate(WARM)
    losses, rates = [], []
    for _ in range(rounds):
        a, b, c, d = (one.rate(ITERATIONS) for one in (plain, chosen, chosen, plain))
        losses.append(100 * (1 - (b + c) / (a + d)))
        rates.append((b + c) / 2)
    yield Row(name, losses, "%", at_most=BAR, note=f"{sorted(rates)[len(rates) // 2]:,.0f} frames per core-second")


def main(rounds: int = ROUNDS, only: tuple[str, ...] = tuple(COMPARED)) -> None:
    """Measure what some curricula cost: A B B A, ``rounds`` times."""
    for name in only:
        require_known("only", name, list(COMPARED))
    print_parts("%: of the frames per second", [partial(cost, name) for name in only], rounds)


if __name__ == "__main__":
    run_from_command_line(main)
