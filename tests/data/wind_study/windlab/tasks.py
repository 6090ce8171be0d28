"""A task of its own."""

import dataclasses

import segar


def slow_task():
    """PuttPutt with a reward for slow balls."""

    def slow(ball: segar.GolfBall, goal: segar.GoalTile) -> float:
        """Less for a ball that moves along x."""
        return -0.5 * abs(ball[segar.Velocity][0])

    return dataclasses.replace(segar.puttputt(), name="slow", reward=slow)
