"""How fast a lab runs experiments, and how long 1,000 laws take to be graded."""

from __future__ import annotations

import time
from collections.abc import Iterator
from dataclasses import replace
from functools import partial

import numpy as np

import segar
from benchmarks.measure import Row, timed
from segar.lab import Grader, Lab, Session
from segar.lab.laws import laws_of
from segar.rules.templates import law_space

EXPERIMENTS, STEPS, LAWS = 2048, 20, 1000


def lab(repeats: int) -> Iterator[Row]:
    """Steps of experiments that are done side by side, as a session counts them; and the time of grades."""
    rng = np.random.default_rng(0)
    made = Lab(segar.family("objectsx1-hard").with_rules(law_space()), budget=EXPERIMENTS * STEPS * (repeats + 1))
    start = {"golfball": {"Position": rng.uniform(-0.9, 0.9, (EXPERIMENTS, 2))}}
    actions = rng.uniform(-1, 1, (EXPERIMENTS, STEPS, 2))
    for noise in (0.0, made.noise):
        session = Session(replace(made, noise=noise))
        seconds = timed(partial(session.experiment, set=start, actions=actions), repeats, time.perf_counter)
        speeds = [EXPERIMENTS * STEPS / each / 1e6 for each in seconds]
        label = f"{EXPERIMENTS} x {STEPS} steps, noise {noise:g}, all cores"
        yield Row(label, speeds, "million steps/s", at_least=1.0)
    grader, laws = Grader(made), laws_of(made.space, made.space.sample(lambda *_: rng, LAWS))
    yield Row(
        f"grades of {LAWS} laws", timed(lambda: grader.grades(laws), repeats, time.process_time), "s", at_most=10.0
    )
