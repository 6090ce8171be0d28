"""Tasks whose own results are right, raise, have the wrong shape, or are no number on some levels."""

import dataclasses
import itertools
import time

import numpy as np

import segar


def wrong(factors):
    raise KeyError("Fuel")


def right_of_centre(factors):
    """The place of the ball; NaN to the left."""
    x = factors["Position"][:, 0, 0]
    return np.where(x > 0, x, np.nan)


def with_result(function):
    return dataclasses.replace(segar.puttputt(), name="own", results={"mine": function})


def unrewarded():
    """A task that rewards nothing."""
    return dataclasses.replace(segar.puttputt(), name="free", reward=())


RNG, CALLS = np.random.default_rng(0), itertools.count()


def drawn(factors):
    """A mass with noise."""
    return factors["Mass"][:, 0] + RNG.normal(size=factors.num_envs)


def counted(factors):
    """How often it was called."""
    return np.full(factors.num_envs, next(CALLS))


random_result, counting, clock = (
    with_result(drawn),
    with_result(counted),
    with_result(lambda factors: np.full(factors.num_envs, time.perf_counter())),
)
raising, misshapen = with_result(wrong), with_result(lambda factors: np.zeros(3))
text, none = (
    with_result(lambda factors: np.array(["left"] * factors.num_envs)),
    with_result(lambda factors: [None] * factors.num_envs),
)
place = with_result(lambda factors: factors["Position"][:, 0])
single, partial = with_result(lambda factors: 1.0), with_result(right_of_centre)
