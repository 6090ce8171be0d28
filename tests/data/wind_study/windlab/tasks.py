"""A task of its own."""

import dataclasses
import importlib
import json
from pathlib import Path

import segar


def weighed(factors):
    """The mass of the ball times what a file and a module say."""
    late = importlib.import_module(f"{__package__}.late")
    return late.SIGN * json.loads((Path(__file__).parent / "weight.json").read_text()) * factors["Mass"][:, 0]


def slow_task():
    """PuttPutt with a reward for slow balls."""

    def slow(ball: segar.GolfBall, goal: segar.GoalTile) -> float:
        """Less for a ball that moves along x."""
        return -0.5 * abs(ball[segar.Velocity][0])

    return dataclasses.replace(segar.puttputt(), name="slow", reward=slow, results={"weighed": weighed})
