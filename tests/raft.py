"""A world of a user's own in one file: a raft in a current that each level draws, stronger in the test, with its own task."""

import dataclasses

import segar
from segar.language import ID
from segar.tasks import distance


class CurrentStrength(segar.Parameter, default=0.3, unit="m/s^2"):
    """How strongly the current pushes to the left."""


class Slowing(segar.Scalar, default=0.2, unit="1/s"):
    """How strongly the water slows a raft."""


class Raft(segar.GolfBall):
    """What floats."""

    slowing: Slowing
    id: ID = "raft"


@segar.rule
def carry(raft: Raft, strength: CurrentStrength) -> segar.Aggregate[segar.Acceleration]:
    """The current pushes to the left, and the water slows."""
    push = segar.Vector((-strength, 0.0)) - raft[Slowing] * raft[segar.Velocity]
    return segar.Aggregate[segar.Acceleration](raft[segar.Acceleration], push)


def landing(limit: int = 60):
    """Bring the raft to the pier, with pushes of up to 3 in each direction."""

    def lands(raft: Raft, pier: segar.GoalTile) -> bool:
        return distance(raft, pier) <= 0.3

    def nearer(raft: Raft, pier: segar.GoalTile) -> float:
        return -distance(raft, pier)

    return dataclasses.replace(
        segar.puttputt(), name="landing", reward=nearer, terminated=lands, success=lands, max_steps=limit,
        action_low=(-3.0, -3.0), action_high=(3.0, 3.0),
    )  # fmt: skip


def water(low: float, high: float) -> segar.LevelDistribution:
    """Levels whose current is uniform from ``low`` to ``high``."""
    return segar.LevelDistribution(
        numbers=[(Raft, 1), (segar.GoalTile, 1)],
        priors=[
            segar.Prior(segar.Position, (-0.6, 0.5), entity_type=Raft),
            segar.Prior(segar.Position, segar.RandomUniformLocation()),
            segar.Prior(Slowing, segar.UniformNoise(0.1, 0.3), entity_type=Raft),
        ],
        parameters={CurrentStrength: segar.UniformNoise(low, high)},
        world=segar.World(rules=[*segar.DEFAULT_RULES, carry]),
        task="tests.raft:landing",
    )


calm, strong = water(0.0, 0.2), water(6.0, 8.0)
