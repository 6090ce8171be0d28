"""PuttPutt in which the goal counts only under conditions: a slow ball, a touched wall, sand. More conditions are harder.

The wall and the sand cost a little in every step until they are touched, so that an agent can learn before its first success.
Both are factors of the ball, which an agent that observes states sees.
"""

import dataclasses
from typing import Tuple  # noqa: UP035 - rules are hinted as the paper prints them

from segar.errors import SegarError
from segar.language import (
    Alive,
    Done,
    Flag,
    GoalTile,
    GolfBall,
    Position,
    SandTile,
    SetFactor,
    Shape,
    Square,
    Task,
    Velocity,
    Wall,
    is_on,
    rule,
)
from segar.levels import LevelDistribution, Prior
from segar.noise import RandomUniformLocation
from segar.rules import DEFAULT_RULES, World
from segar.tasks.puttputt_task import DEATH_PENALTY, GOAL_DISTANCE, distance, puttputt

CONDITIONS = 3
GOAL_SPEED = 1.0  # [m/s] with the first condition, the ball must be as slow as this at the goal
OPEN_PENALTY = 0.05  # per step and condition that is still open; on average d^2 is 0.15 at the start of empty-hard
SAND = Square(0.5)  # [m] side of the square of sand


class Bounced(Flag, default=False):
    """Whether the ball has touched a wall in this episode."""


class Sandy(Flag, default=False):
    """Whether the ball has been on sand in this episode."""


class Contender(GolfBall):
    """A golf ball that remembers which conditions it has met."""

    bounced: Bounced
    sandy: Sandy


@rule
def remember_wall(bounced: Bounced, wall: Wall) -> SetFactor[Bounced]:
    """The ball has touched a wall."""
    return SetFactor[Bounced](bounced, True)


@rule(relation=is_on)
def remember_sand(ball: Tuple[Sandy], sand: SandTile) -> SetFactor[Sandy]:
    """The ball has been on sand."""
    return SetFactor[Sandy](ball[0], True)


def with_conditions(dist: LevelDistribution) -> LevelDistribution:
    """The distribution with a ball that remembers, one more square of sand anywhere, and the rules for both.

    All numbers of conditions are played on the same levels, so that nothing but the reward differs.
    """
    numbers = [(Contender if who is GolfBall else who, many) for who, many in dist.numbers]
    sand = (Prior(Position, RandomUniformLocation(), SandTile), Prior(Shape, SAND, SandTile))
    return dataclasses.replace(
        dist, numbers=(*numbers, (SandTile, 1)), priors=(*dist.priors, *sand), world=remembering_world()
    )


def remembering_world() -> World:
    """The default rules, and that the ball remembers which conditions it has met."""
    return World(rules=[*DEFAULT_RULES, remember_sand], on_contact=[remember_wall])


def conditional_puttputt(conditions: int = 1, max_steps: int = 100, sub_steps: int = 5) -> Task:
    """PuttPutt in which arriving counts once the first ``conditions`` of three are met.

    They are: to be slower than 1 m/s at the goal; to have touched a wall; to have rolled over sand. The levels are those
    of the variation ``conditions``.

    Raises:
        SegarError: ``conditions`` is not 0, 1, 2 or 3.
    """
    if conditions not in range(CONDITIONS + 1):
        raise SegarError(f"conditions: there are 0 to {CONDITIONS} of them, not {conditions!r}")
    slow, wall, sand = (conditions > k for k in range(CONDITIONS))

    def reward(ball: Contender, goal: GoalTile) -> float:
        d = distance(ball, goal)
        value = -(d * d)
        if wall and not ball[Bounced]:
            value = value - OPEN_PENALTY
        if sand and not ball[Sandy]:
            value = value - OPEN_PENALTY
        return value if ball[Alive] else value - DEATH_PENALTY

    def has_arrived(ball: Contender, goal: GoalTile) -> bool:
        if not ball[Alive] or ball[Done]:
            return False
        if wall and not ball[Bounced]:
            return False
        if sand and not ball[Sandy]:
            return False
        near = distance(ball, goal) <= GOAL_DISTANCE
        return near and ball[Velocity].norm() <= GOAL_SPEED if slow else near

    def is_over(ball: Contender, goal: GoalTile) -> bool:
        return ball[Done] or not ball[Alive] or has_arrived(ball, goal)

    return dataclasses.replace(
        puttputt(max_steps=max_steps, sub_steps=sub_steps),
        name=f"conditional-{conditions}",
        reward=reward,
        terminated=is_over,
        success=has_arrived,
    )
