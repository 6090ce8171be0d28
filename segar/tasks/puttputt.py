"""PuttPutt: push the golf ball until it rests its centre on the goal's."""

from __future__ import annotations

from segar.effects import SetFactor
from segar.engine.signature import Action
from segar.entities import GoalTile, GolfBall
from segar.errors import SegarError, did_you_mean
from segar.factors import Alive, Done, Mass, Position, Velocity
from segar.tasks.task import Task
from segar.values import Vector

ARENA_DIAGONAL = 8.0**0.5  # [m] distances are divided by it; 2.828, as in 2022
GOAL_DISTANCE = 0.01  # share of the arena's diagonal at which the ball has arrived
DEATH_PENALTY = 100.0
IMPULSE = 2.0  # [kg m/s] of a unit action


def puttputt(
    reward: str = "squared",
    impulse: float = IMPULSE,
    goal_distance: float = GOAL_DISTANCE,
    death_penalty: float = DEATH_PENALTY,
    max_steps: int = 100,
    sub_steps: int = 5,
) -> Task:
    """The task of the paper's families.

    Args:
        reward: 'squared' is -d^2 (v0), 'linear' is -d (v1), where d is the distance of ball and goal as a share of the
            arena's diagonal, after the step.
        impulse: what a unit action adds to the ball's momentum [kg m/s].
        goal_distance: d at which the ball has arrived.
        death_penalty: subtracted in the step in which the ball dies.

    Raises:
        SegarError: unknown reward.
    """
    if reward not in ("squared", "linear"):
        raise SegarError(f"puttputt has no reward '{reward}'.{did_you_mean(reward, ('squared', 'linear'))}")
    squared = reward == "squared"

    def push(ball: GolfBall, action: Action) -> SetFactor[Velocity]:
        if ball[Mass] == 0:
            return None
        kick = Vector(action[0], action[1]) * impulse
        return SetFactor[Velocity](ball[Velocity], ball[Velocity] + kick / ball[Mass])

    def distance_reward(ball: GolfBall, goal: GoalTile) -> float:
        d = distance(ball, goal)
        near = -(d * d) if squared else -d
        return near if ball[Alive] else near - death_penalty

    def is_over(ball: GolfBall, goal: GoalTile) -> bool:
        return ball[Done] or not ball[Alive] or distance(ball, goal) <= goal_distance

    def has_arrived(ball: GolfBall, goal: GoalTile) -> bool:
        return ball[Alive] and not ball[Done] and distance(ball, goal) <= goal_distance

    def has_died(ball: GolfBall) -> bool:
        return not ball[Alive]

    return Task(
        f"puttputt-{reward}",
        push,
        distance_reward,
        is_over,
        has_arrived,
        has_died,
        max_steps=max_steps,
        sub_steps=sub_steps,
    )


def distance(ball: GolfBall, goal: GoalTile) -> float:
    """Distance of the centres as a share of the arena's diagonal."""
    return (ball[Position] - goal[Position]).norm() / ARENA_DIAGONAL
