"""A world of rules with all elementary functions and all draws, and an own factor."""

from typing import Tuple

import segar
from segar.language import Ball, arctan2, cos, exp, hypot, log, maximum, sin, sqrt, tan, tanh
from segar.rules import accelerate


class Flutter(segar.Scalar, default=0.3):
    """What the wind's direction follows."""


class Leaf(Ball):
    flutter: Flutter = 0.3


@segar.rule
def wind(
    o: Tuple[segar.Velocity, segar.Position, segar.Mass, segar.Acceleration],
) -> segar.Aggregate[segar.Acceleration]:
    """A gust whose direction and strength follow the place by all elementary functions."""
    velocity, place, mass, a = o
    angle = arctan2(place[1], place[0]) + 0.1 * tan(0.5 * place[0])
    strength = 0.3 * exp(-hypot(place[0], place[1])) + 0.1 * log(1.0 + mass) + tanh(velocity[0]) * 0.05
    strength = strength + 0.1 * sqrt(maximum(mass, 0.0)) + 0.02 * maximum(mass, 0.1) ** 1.7
    return segar.Aggregate[segar.Acceleration](a, (strength * cos(angle), strength * sin(angle)))


@segar.rule
def gust(v: segar.Velocity) -> segar.Differential[segar.Velocity]:
    """Random pushes of all three draws."""
    push = segar.random.normal(0.0, 2.0) + segar.random.uniform(-1.0, 1.0)
    return segar.Differential[segar.Velocity](v, (push * segar.random.bernoulli(0.5), segar.random.normal(0.0, 1.0)))


@segar.rule
def turn(flutter: Flutter) -> segar.Differential[Flutter]:
    """The flutter walks at random."""
    return segar.Differential[Flutter](flutter, segar.random.uniform(-1.0, 3.0))


world = segar.World(rules=(accelerate, segar.move, wind, gust, turn))
