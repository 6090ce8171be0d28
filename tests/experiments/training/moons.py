"""Levels with a moon, which has a phase and no position: fixed, different in each level, or turning."""

from typing import Tuple

import segar
from segar.language import Acceleration, Aggregate, Differential, Label, cos


class Phase(segar.Scalar, default=0.5, unit="rad"):
    """Of the moon."""


class Moon(segar.Entity):
    phase: Phase
    label: Label = "moon"


@segar.rule
def turn(moon: Moon) -> Differential[Phase]:
    return Differential[Phase](moon[Phase], 1.0)


@segar.rule
def tide(body: Tuple[Acceleration], moon: Tuple[Phase]) -> Aggregate[Acceleration]:
    (a,), (phase,) = body, moon
    return Aggregate[Acceleration](a, (cos(phase), 0.0))


def levels(*rules, phase=0.5) -> segar.LevelDistribution:
    """A ball, a goal and a moon."""
    return segar.LevelDistribution(
        numbers=[(segar.GolfBall, 1), (segar.GoalTile, 1), (Moon, 1)],
        priors=[
            segar.Prior(segar.Position, segar.RandomUniformLocation()),
            segar.Prior(Phase, phase, entity_type=Moon),
        ],
        world=segar.World(rules=[*segar.DEFAULT_RULES, tide, *rules]),
    )


still, turning, different = levels(), levels(turn), levels(phase=segar.UniformNoise(0.0, 6.0))


class AirSpeed(segar.Parameter, default=0.0, unit="m/s^2"):
    """Of the air."""


def air(breeze, gravity=9.81) -> segar.LevelDistribution:
    """A ball and a goal in a breeze."""
    return segar.LevelDistribution(
        numbers=[(segar.GolfBall, 1), (segar.GoalTile, 1)],
        priors=[segar.Prior(segar.Position, segar.RandomUniformLocation())],
        parameters={AirSpeed: breeze, segar.Gravity: gravity},
    )


calm, stormy, airs = air(0.0), air(1.0), air(segar.UniformNoise(0.0, 1.0))
planets = air(segar.UniformNoise(0.0, 1.0), gravity=segar.UniformNoise(1.0, 20.0))
