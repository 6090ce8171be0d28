"""Tasks whose own results are right, raise, have the wrong shape, or are no number on some levels."""

import dataclasses

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


RNG = np.random.default_rng(0)


def drawn(factors):
    """A mass with noise."""
    return factors["Mass"][:, 0] + RNG.normal(size=factors.num_envs)


random_result = with_result(drawn)
raising, misshapen = with_result(wrong), with_result(lambda factors: np.zeros(3))
text = with_result(lambda factors: np.array(["left"] * factors.num_envs))
place = with_result(lambda factors: factors["Position"][:, 0])
partial = with_result(right_of_centre)
